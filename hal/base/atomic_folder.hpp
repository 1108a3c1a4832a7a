#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace dtact::base {

/// File names, without folder, and contents.
using FolderFiles = std::vector<std::pair<std::string, std::string>>;

/// Writes a folder of files so that at any moment it is either absent, the old one or the new one.
/// An old one is replaced only when it holds nothing but files named in `known`; `what` says in the
/// error what the folder should be ("a calibration"). Throws std::runtime_error.
void write_folder_atomically(const std::filesystem::path& folder, const FolderFiles& files,
                             const std::vector<std::string>& known, const std::string& what);

}  // namespace dtact::base
