#pragma once

#include <sys/socket.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "hal/base/unique_fd.hpp"
#include "proto/framing.hpp"
#include "tests/unit/wire/frozen/dtact_1_0.pb.h"

namespace dtact::frozen {

/// One end of a connection that speaks version 1.0. Whatever goes wrong ends the program with a
/// sentence: a test reads it.
class Stream {
 public:
  explicit Stream(base::UniqueFd fd) : fd_(std::move(fd)) {}

  template <typename Message>
  void send(const Message& message) {
    const auto length = wire::encode_length(message.ByteSizeLong());
    std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&bytes);
    if (::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) !=
        static_cast<ssize_t>(bytes.size())) {
      fail("cannot send");
    }
  }
  /// False at the end of the connection.
  template <typename Message>
  [[nodiscard]] bool receive(Message& message) {
    while (decoder_.feed(unread_) != wire::MessageDecoder::Result::message) {
      const ssize_t n = ::recv(fd_.get(), buffer_, sizeof buffer_, 0);
      if (n <= 0) return false;
      unread_ = {buffer_, static_cast<std::size_t>(n)};
    }
    if (!message.ParseFromString(decoder_.message())) fail("not a message of version 1.0");
    return true;
  }

  [[noreturn]] static void fail(const char* what) {
    std::printf("FAILED: %s\n", what);
    std::exit(1);
  }

 private:
  base::UniqueFd fd_;
  wire::MessageDecoder decoder_;
  char buffer_[65536];
  std::string_view unread_;
};

}  // namespace dtact::frozen
