#include "clients/cpp/options.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <cstdlib>
#include <fstream>

#include "clients/cpp/errors.hpp"

namespace dtact::client {

namespace fs = std::filesystem;

namespace {

/// The permissions that a token's file must not have. A systemd credential (systemd.exec(5)) may
/// belong to root and be readable to the service by an access control list; its mode then shows the
/// list's mask as the rights of root's group.
mode_t forbidden(const fs::path& file, const struct stat& status) {
  const char* folder = std::getenv("CREDENTIALS_DIRECTORY");
  const bool credential =
      folder != nullptr && file.parent_path() == fs::path(folder) && status.st_gid == 0;
  return credential ? S_IRWXO : S_IRWXG | S_IRWXO;
}

}  // namespace

std::string read_token(const fs::path& file) {
  struct stat status{};
  if (::stat(file.c_str(), &status) == 0 && (status.st_mode & forbidden(file, status)) != 0) {
    throw Error(
        fmt::format("{} can be read by others: chmod 600 {}", file.string(), file.string()));
  }
  std::ifstream stream(file);
  std::string token;
  if (!std::getline(stream, token)) {
    throw Error(fmt::format("cannot read a token from {}: it has to be the file's first line",
                            file.string()));
  }
  token.erase(token.find_last_not_of(" \t\r") + 1);
  // The daemon's own file has lines like "control HASH NAME".
  if (token.empty() || token.size() > wire::kMaxToken || token.find(' ') != std::string::npos) {
    throw Error(
        fmt::format("the first line of {} is no token: it has 1 to {} bytes and no blanks. A line "
                    "for the daemon "
                    "has only its hash: the token is in the file of dtactctl token -o",
                    file.string(), wire::kMaxToken));
  }
  return token;
}

}  // namespace dtact::client
