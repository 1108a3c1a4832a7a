#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace dtact::cli {

/// A message as protobuf's own JSON on one line, with a newline: fields by their names in the
/// .proto file, those at zero too; 64-bit integers as strings, enumerations by name, bytes in
/// base64.
[[nodiscard]] std::string json_line(const google::protobuf::Message& message);

}  // namespace dtact::cli
