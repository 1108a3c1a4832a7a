#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "hal/base/clock.hpp"

namespace dtact::fakes {

/// Time that passes only by sleeping or by hand.
class FakeClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override { return now; }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override { return now + kWallOffset; }
  void sleep_until(std::int64_t deadline_ns) noexcept override {
    now = std::max(now.load(), deadline_ns);
  }
  static constexpr std::int64_t kWallOffset = 1'000'000'000'000'000'000;
  std::atomic<std::int64_t> now{1'000'000};
};

}  // namespace dtact::fakes
