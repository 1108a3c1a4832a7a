#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace dtact::base {

/// Replaces `path` by write, fsync, rename, so that at any moment it is wholly the old or the new
/// file, with at most the permissions of `mode`. Throws std::system_error naming the path.
void write_file_atomically(const std::filesystem::path& path, std::string_view content,
                           mode_t mode = 0644);

/// The whole file. Throws std::system_error naming the path; refuses more than `limit` bytes.
[[nodiscard]] std::string read_file(const std::filesystem::path& path,
                                    std::size_t limit = 64U << 20U);

/// The same without the byte order mark that some programs put before text (UTF-8's EF BB BF).
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path,
                                         std::size_t limit = 64U << 20U);

/// Makes a rename in `folder` last through a power cut. Throws std::system_error.
void sync_folder(const std::filesystem::path& folder);

/// File names, without folder, and contents.
using FolderFiles = std::vector<std::pair<std::string, std::string>>;

/// Writes a folder of files so that at any moment it is either absent, the old one or the new one.
/// An old one is replaced only when it holds nothing but files named in `known`. `what` says in the
/// error what the folder should be ("a calibration"). Throws std::runtime_error.
void write_folder_atomically(const std::filesystem::path& folder, const FolderFiles& files,
                             const std::vector<std::string>& known, const std::string& what);

}  // namespace dtact::base
