#include "hal/base/atomic_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "hal/base/unique_fd.hpp"

namespace dtact::base {
namespace {

[[noreturn]] void fail(int error, const char* what, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), std::string(what) + " " + path.string());
}

}  // namespace

void sync_folder(const std::filesystem::path& folder) {
  const auto& path = folder.empty() ? std::filesystem::path(".") : folder;
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd) fail(errno, "cannot open folder", path);
  if (::fsync(fd.get()) != 0 && errno != EINVAL) fail(errno, "cannot sync folder", path);
}

void write_file_atomically(const std::filesystem::path& path, std::string_view content,
                           mode_t mode) {
  std::string temporary = path.string() + ".XXXXXX";
  UniqueFd fd(::mkostemp(temporary.data(), O_CLOEXEC));
  if (!fd) fail(errno, "cannot write", path);
  const auto give_up = [&](int error) {
    ::unlink(temporary.c_str());
    fail(error, "cannot write", path);
  };
  while (!content.empty()) {
    const ssize_t n = ::write(fd.get(), content.data(), content.size());
    if (n < 0) {
      if (errno == EINTR) continue;
      give_up(errno);
    }
    content.remove_prefix(static_cast<std::size_t>(n));
  }
  // mkostemp makes the file private.
  if (::fchmod(fd.get(), mode) != 0) give_up(errno);
  if (::fsync(fd.get()) != 0) give_up(errno);
  fd.reset();
  if (std::rename(temporary.c_str(), path.c_str()) != 0) give_up(errno);
  sync_folder(path.parent_path());
}

std::string read_file(const std::filesystem::path& path, std::size_t limit) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) fail(errno, "cannot read", path);
  std::string content;
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::read(fd.get(), buffer, sizeof buffer);
    if (n < 0) {
      if (errno == EINTR) continue;
      fail(errno, "cannot read", path);
    }
    if (n == 0) return content;
    content.append(buffer, static_cast<std::size_t>(n));
    if (content.size() > limit) fail(EFBIG, "cannot read", path);
  }
}

}  // namespace dtact::base
