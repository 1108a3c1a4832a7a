#pragma once

#include <cstdint>

namespace dtact::base {

/// Time, so that tests can make their own. All values are nanoseconds.
class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  [[nodiscard]] virtual std::int64_t monotonic_ns() const noexcept = 0;  ///< CLOCK_MONOTONIC
  [[nodiscard]] virtual std::int64_t wall_ns() const noexcept = 0;       ///< CLOCK_REALTIME
  /// Returns when monotonic_ns() has reached `deadline_ns`; at once when it has passed.
  virtual void sleep_until(std::int64_t deadline_ns) noexcept = 0;
};

/// The machine's clock. Stateless; one object serves the program.
[[nodiscard]] Clock& system_clock() noexcept;

}  // namespace dtact::base
