#pragma once

#include <time.h>

#include <cstdint>

namespace dtact::bench {

/// Processor time of this thread, nanoseconds: other programs on the core do not count.
[[nodiscard]] inline std::int64_t thread_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}

/// The same in microseconds.
[[nodiscard]] inline double thread_us() { return static_cast<double>(thread_ns()) * 1e-3; }

/// This time of `work`, milliseconds.
template <typename Work>
[[nodiscard]] double cpu_ms(Work work) {
  const std::int64_t began = thread_ns();
  work();
  return static_cast<double>(thread_ns() - began) * 1e-6;
}

}  // namespace dtact::bench
