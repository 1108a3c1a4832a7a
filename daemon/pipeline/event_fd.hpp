#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

#include "hal/base/unique_fd.hpp"

namespace dtact::pipeline {

/// A descriptor that any thread makes readable and a poll loop waits on. Never blocks.
class EventFd {
 public:
  EventFd() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (!fd_) throw std::system_error(errno, std::generic_category(), "cannot make an eventfd");
  }
  [[nodiscard]] int get() const noexcept { return fd_.get(); }
  void signal() const noexcept {
    const std::uint64_t one = 1;
    // Fails only when the count is at its end, and then the descriptor is readable anyway.
    [[maybe_unused]] const ssize_t written = ::write(fd_.get(), &one, sizeof one);
  }

 private:
  base::UniqueFd fd_;
};

}  // namespace dtact::pipeline
