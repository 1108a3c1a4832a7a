#pragma once

#include <semaphore.h>
#include <time.h>

#include <cerrno>
#include <cstdint>

namespace dtact::base {

/// Wakes a thread that has nothing to do. ring() neither waits nor allocates, so the capture thread
/// may call it.
class Doorbell {
 public:
  Doorbell() noexcept { ::sem_init(&semaphore_, 0, 0); }
  Doorbell(const Doorbell&) = delete;
  Doorbell& operator=(const Doorbell&) = delete;
  ~Doorbell() { ::sem_destroy(&semaphore_); }

  void ring() noexcept { ::sem_post(&semaphore_); }
  /// Returns once for every ring(), however long ago.
  void wait() noexcept {
    while (::sem_wait(&semaphore_) != 0 && errno == EINTR) {
    }
  }

  /// Waits for at most `ns`; true when it was rung.
  bool wait_for(std::int64_t ns) noexcept {
    constexpr std::int64_t kSecond = 1'000'000'000;
    timespec until{};
    ::clock_gettime(CLOCK_MONOTONIC, &until);
    const std::int64_t at = until.tv_nsec + ns;
    until.tv_sec += at / kSecond;
    until.tv_nsec = at % kSecond;
    int result = 0;
    while ((result = ::sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &until)) != 0 &&
           errno == EINTR) {
    }
    return result == 0;
  }

 private:
  sem_t semaphore_{};
};

}  // namespace dtact::base
