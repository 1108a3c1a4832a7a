#include "daemon/serve/private_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "hal/base/unique_fd.hpp"

namespace dtact::net {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{64} * 1024;

}  // namespace

std::string read_private_file(const std::filesystem::path& path, const std::string& what) {
  const auto fail = [&](const std::string& why) {
    throw std::runtime_error(fmt::format("{} {}: {}", what, path.string(), why));
  };
  // Without waiting for the writer of a pipe, which is refused below.
  const base::UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd) {
    const int error = errno;
    fail(fmt::format("{}; check the path, and that the daemon's user may read it",
                     std::strerror(error)));
  }
  struct stat status{};
  if (::fstat(fd.get(), &status) != 0 || !S_ISREG(status.st_mode)) fail("is not a regular file");
  const mode_t others = status.st_gid == 0 ? S_IRWXO : S_IRWXG | S_IRWXO;
  if ((status.st_mode & others) != 0) {
    fail(fmt::format("is open to others (mode {:o}): chmod 600 {}", status.st_mode & 0777U,
                     path.string()));
  }
  std::string text;
  std::array<char, 4096> piece{};
  for (;;) {
    const ssize_t n = ::read(fd.get(), piece.data(), piece.size());
    if (n < 0) {
      const int error = errno;
      fail(std::strerror(error));
    }
    if (n == 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(n));
    if (text.size() > kMaxBytes) fail(fmt::format("is larger than {} bytes", kMaxBytes));
  }
}

}  // namespace dtact::net
