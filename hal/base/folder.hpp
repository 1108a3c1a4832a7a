#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace dtact::base {

/// Natural order: as text, but numbers by their value, so that "2.png" comes before "10.png".
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

/// What a folder holds, in natural order of the names, without hidden files (names that begin with
/// a full stop; macOS puts "._frame.png" beside each file). Throws
/// std::filesystem::filesystem_error.
[[nodiscard]] std::vector<std::filesystem::path> visible_files(const std::filesystem::path& folder);

}  // namespace dtact::base
