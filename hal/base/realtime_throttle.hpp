#pragma once

#include <chrono>
#include <cstdint>

#include "hal/base/clock.hpp"

namespace dtact::base {

/// Keeps a real-time thread from running on and on. One with more work than it can do never waits:
/// other programs on its CPU would get nothing, and the unit's LimitRTTIME= would end the process.
/// All calls are on that thread.
class RealtimeThrottle {
 public:
  /// A thread that has not waited for this long …
  static constexpr std::chrono::milliseconds kInterval{100};

  /// … sleeps for `pause`.
  RealtimeThrottle(Clock& clock, std::chrono::milliseconds pause)
      : clock_(clock), pause_(pause), looked_ns_(clock.monotonic_ns()) {}

  /// To be called often. Whether the thread has waited is what the kernel counts (getrusage(2),
  /// voluntary context switches).
  void pause_if_busy() noexcept;

 private:
  Clock& clock_;
  std::chrono::nanoseconds pause_;
  std::int64_t looked_ns_;
  long waits_ = 0;  ///< Voluntary context switches when last looked at; too few at first.
};

}  // namespace dtact::base
