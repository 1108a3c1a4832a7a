#include "hal/files/mcap_file_sink.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace dtact::mcap {
namespace {

[[noreturn]] void fail(int error, const std::filesystem::path& path) {
  throw std::system_error(error, std::generic_category(), path.string());
}

}  // namespace

FileSink::FileSink(const std::filesystem::path& path, bool replace,
                   const std::filesystem::path& called)
    : path_(called.empty() ? path : called),
      fd_(::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | (replace ? O_TRUNC : O_EXCL),
                 0644)) {
  if (!fd_) fail(errno, path_);
}

void FileSink::append(std::string_view bytes) {
  std::string_view left = bytes;
  while (!left.empty()) {
    const ssize_t written = ::write(fd_.get(), left.data(), left.size());
    if (written > 0) {
      left.remove_prefix(static_cast<std::size_t>(written));
      continue;
    }
    if (written < 0 && errno == EINTR) continue;
    const int error = written == 0 ? ENOSPC : errno;
    // Fails where writing does for another reason than space; then the reader finds the end itself.
    if (::ftruncate(fd_.get(), static_cast<off_t>(size_)) == 0) {
      ::lseek(fd_.get(), 0, SEEK_END);
    }
    fail(error, path_);
  }
  size_ += bytes.size();
}

void FileSink::sync() {
  // A pipe or a device has nothing to sync.
  if (::fdatasync(fd_.get()) != 0 && errno != EINVAL && errno != EROFS) fail(errno, path_);
}

}  // namespace dtact::mcap
