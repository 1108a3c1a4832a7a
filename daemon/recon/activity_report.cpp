// What a look at a frame tells besides the active tiles: whether only the light changed, and how
// the frame differs from the one before.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "daemon/recon/activity.hpp"

namespace dtact::recon {
namespace {

/// Root mean square of the second difference of the values that are added one after the other.
class Ripple {
 public:
  void add(double value) noexcept {
    last_ = {value, last_[0], last_[1]};
    const double bend = last_[0] - 2 * last_[1] + last_[2];
    if (++count_ > 2) squares_ += bend * bend;
  }
  [[nodiscard]] double root_mean_square() const noexcept {
    return std::sqrt(squares_ / std::max(1, count_ - 2));
  }

 private:
  std::array<double, 3> last_{};
  double squares_ = 0;
  int count_ = 0;
};

}  // namespace

void Activity::compare_light(const vec::ChangeLimits& limits, bool all_quiet,
                             ActivityReport& report) const noexcept {
  const int cells = columns_ * rows_;
  double change = report.quiet_change;  // levels
  if (!all_quiet) {
    // A light that changed enough to make any cell active makes most of them active.
    if (active_cells_ > 0 && 2 * active_cells_ < cells) return;
    std::int64_t total = 0;
    for (int row = 0; row < rows_; ++row) {
      const std::int32_t* const from = &change_[margin_ + at(0, row)];
      total = std::accumulate(from, from + columns_, total);
    }
    change = static_cast<double>(total) / kQ16 / cells;
    const auto factor = static_cast<float>(change / (mean_reference_ + mean_drift_));
    const auto most = static_cast<float>(limits.cell_on);
    int unlike = 0;
    for (int row = 0; row < rows_; ++row) {
      const std::int32_t* const changes = &change_[margin_ + at(0, row)];
      const std::int32_t* const expected = &expected_[at(0, row)];
      for (int i = 0; i < columns_; ++i) {
        const float left =
            static_cast<float>(changes[i]) - factor * static_cast<float>(expected[i]);
        unlike += static_cast<int>(std::abs(left) > most);
      }
    }
    if (unlike > 0) return;
  }
  report.light_alone = mean_reference_ > 0;
  if (report.light_alone) report.light_change = (change + mean_drift_) / mean_reference_;
}

void Activity::compare_with_before(ActivityReport& report) const noexcept {
  Ripple ripple;
  Ripple fine;
  std::int64_t rough = 0;
  const std::int32_t darkest = settings_.limits.dark * vec::kCellPixels;
  const std::int32_t brightest = settings_.limits.saturated * vec::kCellPixels;
  for (int row = 0; row < rows_; ++row) {
    const std::int32_t* const now = &sum_[at(0, row)];
    const std::int32_t* const before = &sum_before_[at(0, row)];
    const std::int32_t* const upper_now = &upper_[at(0, row)];
    const std::int32_t* const upper_before = &upper_before_[at(0, row)];
    const std::int32_t* const roughness = &rough_[at(0, row)];
    // Sums over one row fit 32 bits, which the compiler turns into vector code.
    std::int32_t step = 0;
    std::int32_t upper_step = 0;
    std::int32_t rough_row = 0;
    std::int32_t changed = 0;
    std::int32_t open = 0;  // cells that are not clipped
    for (int i = 0; i < columns_; ++i) {
      step += now[i] - before[i];
      upper_step += upper_now[i] - upper_before[i];
      rough_row += roughness[i];
      changed |= now[i] ^ before[i];
      open += static_cast<std::int32_t>(now[i] > darkest) &
              static_cast<std::int32_t>(now[i] < brightest);
    }
    rough += rough_row;
    report.unchanged_rows += changed == 0 && 2 * open > columns_ ? 1 : 0;
    ripple.add(step);
    fine.add(upper_step);
    fine.add(step - upper_step);
  }
  const double pixels = static_cast<double>(columns_) * vec::kCellPixels;
  report.ripple = ripple.root_mean_square() / pixels;
  report.fine_ripple = fine.root_mean_square() / (pixels / 2);
  report.rough_noise =
      kFromDifference * static_cast<double>(rough) / (columns_ * rows_) / vec::kRoughPixels;
}

}  // namespace dtact::recon
