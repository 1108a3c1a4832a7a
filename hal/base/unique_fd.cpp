#include "hal/base/unique_fd.hpp"

#include <cerrno>

namespace dtact::base {

void UniqueFd::reset(int fd) noexcept {
  const int old = std::exchange(fd_, fd);
  if (old < 0 || old == fd) return;
  // Linux closes the descriptor even when close() reports EINTR, so it is never tried again.
  const int saved = errno;
  ::close(old);
  errno = saved;
}

}  // namespace dtact::base
