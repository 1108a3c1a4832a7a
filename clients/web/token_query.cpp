#include "clients/web/token_query.hpp"

#include <algorithm>
#include <charconv>

namespace dtact::web {

std::string token_of(std::string_view target) {
  const auto question = target.find('?');
  std::string_view rest = question == std::string_view::npos ? "" : target.substr(question + 1);
  while (!rest.empty()) {
    std::string_view part = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(rest.size(), part.size() + 1));
    if (!part.starts_with("token=")) continue;
    part.remove_prefix(6);
    std::string token;
    while (!part.empty()) {
      unsigned value = 0;
      const bool coded =
          part.size() >= 3 && part[0] == '%' &&
          std::from_chars(part.data() + 1, part.data() + 3, value, 16).ptr == part.data() + 3;
      token += coded ? static_cast<char>(value) : part[0];
      part.remove_prefix(coded ? 3 : 1);
    }
    return token;
  }
  return "";
}

}  // namespace dtact::web
