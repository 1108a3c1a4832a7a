#include "clients/cpp/options.hpp"

#include <fmt/format.h>

#include <fstream>
#include <system_error>

#include "clients/cpp/errors.hpp"

namespace dtact::client {

namespace fs = std::filesystem;

std::string read_token(const fs::path& file) {
  std::error_code error;
  const fs::perms permissions = fs::status(file, error).permissions();
  constexpr fs::perms kOthers = fs::perms::group_all | fs::perms::others_all;
  if (!error && (permissions & kOthers) != fs::perms::none) {
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
  // Of the daemon's own file it would be a line like "control TOKEN NAME".
  if (token.empty() || token.size() > wire::kMaxToken || token.find(' ') != std::string::npos) {
    throw Error(fmt::format(
        "the first line of {} is no token: it has 1 to {} bytes and no blanks. Of a line for the "
        "daemon (dtactctl token) it is the second word",
        file.string(), wire::kMaxToken));
  }
  return token;
}

}  // namespace dtact::client
