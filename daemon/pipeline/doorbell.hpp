#pragma once

#include <semaphore.h>

#include <cerrno>

namespace dtact::pipeline {

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

 private:
  sem_t semaphore_{};
};

}  // namespace dtact::pipeline
