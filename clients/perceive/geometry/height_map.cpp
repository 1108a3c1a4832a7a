#include "clients/perceive/geometry/height_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace dtact::perceive {
namespace {

constexpr double kMmPerUm = 1e-3;

/// What the four nodes around count at a share of the way from the second to the third.
struct Weights {
  std::array<double, 4> value;
  std::array<double, 4> slope;  ///< Per node.
};
Weights weights_at(double s) {
  return {{s * (s * (1 - s / 2) - 0.5), s * s * (1.5 * s - 2.5) + 1, s * (s * (2 - 1.5 * s) + 0.5),
           s * s * (s - 1) / 2},
          {s * (2 - 1.5 * s) - 0.5, s * (4.5 * s - 5), s * (4 - 4.5 * s) + 0.5, s * (1.5 * s - 1)}};
}

}  // namespace

HeightMap::HeightMap(const recon::SurfaceHeights& heights)
    : columns_(heights.width),
      rows_(heights.height),
      spacing_mm_(heights.spacing_mm),
      half_width_mm_((columns_ - 1) * spacing_mm_ / 2),
      half_height_mm_((rows_ - 1) * spacing_mm_ / 2) {
  constexpr int kLeast = 4;
  if (columns_ < kLeast || rows_ < kLeast || !(spacing_mm_ > 0) ||
      heights.z_um.size() != static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {
    throw std::invalid_argument("a height map's sizes contradict each other");
  }
  const std::ptrdiff_t pitch = columns_ + 2;
  z_mm_.resize(static_cast<std::size_t>(pitch) * static_cast<std::size_t>(rows_ + 2));
  const auto continued = [](double* at, std::ptrdiff_t step) {
    *at = 3 * at[step] - 3 * at[2 * step] + at[3 * step];
  };
  for (std::ptrdiff_t row = 0; row < rows_; ++row) {
    double* out = z_mm_.data() + (row + 1) * pitch;
    for (std::ptrdiff_t column = 0; column < columns_; ++column) {
      out[column + 1] = heights.z_um[static_cast<std::size_t>(row * columns_ + column)] * kMmPerUm;
    }
    continued(out, 1);
    continued(out + pitch - 1, -1);
  }
  for (std::ptrdiff_t column = 0; column < pitch; ++column) {
    continued(z_mm_.data() + column, pitch);
    continued(z_mm_.data() + (rows_ + 1) * pitch + column, -pitch);
  }
  // The weights' sum is 1, that of their sizes at most 1.25 along each side.
  constexpr double kMostWeight = 1.25 * 1.25;
  const auto [low, high] = std::ranges::minmax(z_mm_);
  const double middle = (low + high) / 2;
  // Rounding must not put a level surface beyond them.
  constexpr double kRoundingMm = 1e-6;
  const double reach = kMostWeight * (high - low) / 2 + kRoundingMm;
  low_mm_ = middle - reach;
  high_mm_ = middle + reach;
}

HeightMap::Height HeightMap::inside(double x_mm, double y_mm) const {
  const double column = (x_mm + half_width_mm_) / spacing_mm_;
  const double row = (y_mm + half_height_mm_) / spacing_mm_;
  const int c = std::clamp(static_cast<int>(column), 0, columns_ - 2);
  const int r = std::clamp(static_cast<int>(row), 0, rows_ - 2);
  const Weights across = weights_at(column - c);
  const Weights down = weights_at(row - r);
  // The node before the cell's own, which the continuation has moved by one.
  const double* node = z_mm_.data() + std::ptrdiff_t{r} * (columns_ + 2) + c;
  Height height;
  for (std::size_t i = 0; i < 4; ++i, node += columns_ + 2) {
    double value = 0;
    double slope = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      value += across.value[k] * node[k];
      slope += across.slope[k] * node[k];
    }
    height.z_mm += down.value[i] * value;
    height.slope_x += down.value[i] * slope / spacing_mm_;
    height.slope_y += down.slope[i] * value / spacing_mm_;
  }
  return height;
}

std::optional<HeightMap::Height> HeightMap::at(double x_mm, double y_mm) const {
  if (!(std::abs(x_mm) <= half_width_mm_ && std::abs(y_mm) <= half_height_mm_)) return {};
  return inside(x_mm, y_mm);
}

HeightMap::Above HeightMap::above(const Vector& point) const {
  const Height height = inside(point[0], point[1]);
  return {point[2] - height.z_mm, height};
}

std::optional<double> HeightMap::reached(const Vector& from, const Vector& direction) const {
  if (!(direction[2] > 0)) return std::nullopt;
  // Outside of these it is below or above all of the surface, or beside the grid.
  double low = std::max(0.0, (low_mm_ - from[2]) / direction[2]);
  double end = (high_mm_ - from[2]) / direction[2];
  const std::array half{half_width_mm_, half_height_mm_};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double room = half[axis] - std::abs(from[axis]);
    if (direction[axis] != 0) end = std::min(end, room / std::abs(direction[axis]));
    if (room < 0) return std::nullopt;
  }
  if (!(low <= end) || above(along(from, low, direction)).mm > 0) return std::nullopt;
  // Half a cell at a time, lest a first crossing be passed over.
  const double sideways = std::hypot(direction[0], direction[1]) * (end - low);
  const int steps = 1 + static_cast<int>(2 * sideways / spacing_mm_);
  const double step = (end - low) / steps;
  double high = low;
  for (int i = 1; i <= steps; ++i) {
    high = i < steps ? low + step : end;
    if (above(along(from, high, direction)).mm >= 0) break;
    if (i == steps) return std::nullopt;
    low = high;
  }
  // Newton's steps as long as they stay between the two, else halves.
  constexpr int kMostSteps = 60;
  constexpr double kCloseMm = 1e-10;
  double t = (low + high) / 2;
  for (int i = 0; i < kMostSteps; ++i) {
    const Above here = above(along(from, t, direction));
    if (std::abs(here.mm) < kCloseMm) break;
    (here.mm < 0 ? low : high) = t;
    const double climb =
        direction[2] - here.height.slope_x * direction[0] - here.height.slope_y * direction[1];
    t -= here.mm / climb;
    if (!(t > low && t < high)) t = (low + high) / 2;
  }
  return t;
}

}  // namespace dtact::perceive
