#pragma once

#include <array>
#include <cstdint>

namespace dtact::ctl {

/// Percentiles of delays in steps of 50 µs up to one second, in constant memory however long a
/// watch lasts. What is longer counts as one second, what is negative as zero.
class LatencyHistogram {
 public:
  static constexpr std::int64_t kStepNs = 50'000;
  static constexpr std::size_t kSteps = 20'000;

  void add(std::int64_t delay_ns) noexcept;
  /// The delay in milliseconds (upper end of its step) that the fraction `p` (0 … 1) of all stay
  /// within; 0 when there are none.
  [[nodiscard]] double percentile_ms(double p) const noexcept;
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  void reset() noexcept;

 private:
  std::array<std::uint32_t, kSteps> steps_{};
  std::uint64_t count_ = 0;
};

}  // namespace dtact::ctl
