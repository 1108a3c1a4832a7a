#pragma once

#include <span>
#include <string_view>

namespace dtact::web {

/// A file that lies in the program.
struct BuiltIn {
  std::string_view name;  ///< "app.js"
  std::string_view bytes;
};

/// What embed.cmake put there.
[[nodiscard]] std::span<const BuiltIn> built_in_page();

}  // namespace dtact::web
