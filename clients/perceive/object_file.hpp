#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "clients/perceive/pose/object_model.hpp"

namespace dtact::perceive {

/// A known object of an STL or PLY file whose unit is "mm" or "m"; its name is the file's without
/// folder and extension, with '?' for what is not UTF-8. Throws std::runtime_error
/// (std::system_error where it cannot be read) naming the file, the place in it, and the fix.
[[nodiscard]] std::shared_ptr<const ObjectModel> load_object(const std::filesystem::path& file,
                                                             const std::string& unit);

}  // namespace dtact::perceive
