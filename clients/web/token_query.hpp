#pragma once

#include <string>
#include <string_view>

namespace dtact::web {

/// What "token=" is in the part of a target behind '?', its %XX read; empty where there is none.
[[nodiscard]] std::string token_of(std::string_view target);

}  // namespace dtact::web
