#pragma once

#include <filesystem>
#include <string>

namespace dtact::net {

/// A file with a secret in it, at most 64 kB. `what` names it in errors ("the token file"). Throws
/// std::runtime_error with path and fix when it cannot be read, is no regular file, or others
/// than its owner may read it. root's group may: systemd hands out credentials that way.
[[nodiscard]] std::string read_private_file(const std::filesystem::path& path,
                                            const std::string& what);

}  // namespace dtact::net
