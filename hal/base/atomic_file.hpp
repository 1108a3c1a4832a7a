#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace dtact::base {

/// Replaces `path` by write, fsync, rename, so that at any moment it is the old file or the new one
/// as a whole, readable as `mode` says and never by more. Throws std::system_error naming the path.
void write_file_atomically(const std::filesystem::path& path, std::string_view content,
                           mode_t mode = 0644);

/// The whole file. Throws std::system_error naming the path; refuses more than `limit` bytes.
[[nodiscard]] std::string read_file(const std::filesystem::path& path,
                                    std::size_t limit = 64U << 20U);

/// Makes a rename in `folder` last through a power cut. Throws std::system_error.
void sync_folder(const std::filesystem::path& folder);

}  // namespace dtact::base
