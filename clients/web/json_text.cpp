#include "clients/web/json_text.hpp"

#include <fmt/format.h>

namespace dtact::web {

std::string json_string(std::string_view text) {
  std::string json = "\"";
  for (const char sign : text) {
    const auto byte = static_cast<unsigned char>(sign);
    if (sign == '"' || sign == '\\') {
      json += '\\';
      json += sign;
    } else if (byte < 0x20) {
      json += fmt::format("\\u{:04x}", byte);
    } else {
      json += sign;
    }
  }
  return json + '"';
}

}  // namespace dtact::web
