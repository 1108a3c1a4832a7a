#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <string_view>

namespace dtact::cli {

/// A message as JSON on one line, with a newline: fields by their names in the .proto file and in
/// its order, those at zero too and those that are unset not. Numbers of all types are numbers;
/// what is none is null. Enumerations are named, bytes are in base64.
/// protobuf's own printer writes integers of 64 bits as strings.
[[nodiscard]] std::string json_line(const google::protobuf::Message& message);

/// `text` as a string of JSON with its quotation marks. Bytes that are not UTF-8 become U+FFFD.
[[nodiscard]] std::string json_string(std::string_view text);

[[nodiscard]] std::string base64(std::string_view bytes);

}  // namespace dtact::cli
