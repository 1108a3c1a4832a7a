#pragma once

#include <google/protobuf/message.h>

namespace dtact::cli {

/// Replaces control characters in the message's texts by '?': a terminal would obey what a daemon
/// says of itself and of its camera. Fields of bytes stay.
void make_printable(google::protobuf::Message& message);

template <typename Message>
[[nodiscard]] Message printable(Message message) {
  make_printable(message);
  return message;
}

}  // namespace dtact::cli
