#include "clients/ctl/latency.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::ctl {

void LatencyHistogram::add(std::int64_t delay_ns) noexcept {
  const auto step = std::clamp<std::int64_t>(delay_ns / kStepNs, 0, kSteps - 1);
  ++steps_[static_cast<std::size_t>(step)];
  ++count_;
}

double LatencyHistogram::percentile_ms(double p) const noexcept {
  if (count_ == 0) return 0;
  const auto wanted = std::max(1.0, std::ceil(p * static_cast<double>(count_)));
  double seen = 0;
  std::size_t step = 0;
  for (; step + 1 < kSteps; ++step) {
    seen += steps_[step];
    if (seen >= wanted) break;
  }
  return static_cast<double>(step + 1) * static_cast<double>(kStepNs) * 1e-6;
}

void LatencyHistogram::reset() noexcept {
  steps_.fill(0);
  count_ = 0;
}

}  // namespace dtact::ctl
