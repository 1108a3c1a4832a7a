#pragma once

#include <sys/ioctl.h>

#include <cerrno>

namespace dtact::hal::v4l2 {

/// ioctl() that is tried again when a signal interrupts it. Returns 0 or the errno.
template <typename Argument>
[[nodiscard]] int call(int fd, unsigned long request, Argument& argument) noexcept {
  while (::ioctl(fd, request, &argument) == -1) {
    if (errno != EINTR) return errno;
  }
  return 0;
}

}  // namespace dtact::hal::v4l2
