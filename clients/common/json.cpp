#include "clients/common/json.hpp"

#include <google/protobuf/util/json_util.h>

#include <stdexcept>

namespace dtact::cli {

std::string json_line(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(message, &text, options);
  // Only a text that is not UTF-8 can fail.
  if (!status.ok()) throw std::runtime_error("no JSON: " + status.ToString());
  return text + '\n';
}

}  // namespace dtact::cli
