#include "daemon/pipeline/reference/cell_sums.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace dtact::pipeline {
namespace {

namespace vec = recon::vec;

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

CellSums::CellSums(const recon::CellLattice& lattice, const CellLimits& limits)
    : lattice_(lattice), limits_(limits) {
  for (auto* plane : {&sum_, &sum_before_, &upper_, &upper_before_, &rough_}) {
    plane->resize(lattice.at(0, lattice.rows()));
  }
}

void CellSums::add(const std::uint8_t* luma, std::ptrdiff_t stride) noexcept {
  std::swap(sum_, sum_before_);
  std::swap(upper_, upper_before_);
  saturated_ = 0;
  ++frames_;
  const int last = lattice_.columns() - 1;
  const bool overlaps = lattice_.last_column_overlaps();
  for (int row = 0; row < lattice_.rows(); ++row) {
    const std::uint8_t* const from = luma + lattice_.y_of(row) * stride;
    const auto sum = [&](int column, int cells) {
      const std::size_t i = lattice_.at(column, row);
      vec::sum_cells(from + lattice_.x_of(column), stride, cells, limits_.saturated, &sum_[i],
                     &upper_[i], &rough_[i], saturated_);
    };
    sum(0, overlaps ? last : last + 1);
    if (overlaps) sum(last, 1);
  }
}

FrameStatistics CellSums::statistics() const noexcept {
  FrameStatistics statistics;
  statistics.pixels = std::int64_t{lattice_.cells()} * vec::kCellPixels;
  statistics.saturated = saturated_;
  if (frames_ < 2) return statistics;
  Ripple ripple;
  Ripple fine;
  std::int64_t rough = 0;
  const std::int32_t darkest = limits_.dark * vec::kCellPixels;
  const std::int32_t brightest = limits_.saturated * vec::kCellPixels;
  for (int row = 0; row < lattice_.rows(); ++row) {
    const std::size_t first = lattice_.at(0, row);
    const std::int32_t* const now = &sum_[first];
    const std::int32_t* const before = &sum_before_[first];
    const std::int32_t* const upper_now = &upper_[first];
    const std::int32_t* const upper_before = &upper_before_[first];
    const std::int32_t* const roughness = &rough_[first];
    // Sums over one row fit 32 bits, which the compiler turns into vector code.
    std::int32_t step = 0;
    std::int32_t upper_step = 0;
    std::int32_t rough_row = 0;
    std::int32_t changed = 0;
    std::int32_t open = 0;  // cells that are not clipped
    for (int i = 0; i < lattice_.columns(); ++i) {
      step += now[i] - before[i];
      upper_step += upper_now[i] - upper_before[i];
      rough_row += roughness[i];
      changed |= now[i] ^ before[i];
      open += static_cast<std::int32_t>(now[i] > darkest) &
              static_cast<std::int32_t>(now[i] < brightest);
    }
    rough += rough_row;
    statistics.unchanged_rows += changed == 0 && 2 * open > lattice_.columns() ? 1 : 0;
    ripple.add(step);
    fine.add(upper_step);
    fine.add(step - upper_step);
  }
  const double pixels = static_cast<double>(lattice_.columns()) * vec::kCellPixels;
  statistics.ripple = ripple.root_mean_square() / pixels;
  statistics.fine_ripple = fine.root_mean_square() / (pixels / 2);
  statistics.rough_noise =
      kFromDifference * static_cast<double>(rough) / lattice_.cells() / vec::kRoughPixels;
  return statistics;
}

}  // namespace dtact::pipeline
