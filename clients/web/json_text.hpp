#pragma once

#include <string>
#include <string_view>

namespace dtact::web {

/// `text`, which is UTF-8, as a string of JSON with its quotation marks.
[[nodiscard]] std::string json_string(std::string_view text);

}  // namespace dtact::web
