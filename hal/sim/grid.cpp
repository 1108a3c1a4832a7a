#include "hal/sim/grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

namespace dtact::hal::sim {
namespace {

// The bulge of a press has fallen to a thousandth at about this many thicknesses.
constexpr double kMargin = 4;

// The greatest distances from the centre that the camera sees, along either axis: on the image's
// rim.
Place reach_of(const Scene& scene) {
  const CameraModel& camera = scene.camera;
  Place reach;
  const auto see = [&](int column, int row) {
    const Place place = unrolled(scene.surface, pixel_place(camera, column, row));
    reach.x_mm = std::max(reach.x_mm, -place.x_mm);
    reach.y_mm = std::max(reach.y_mm, -place.y_mm);
  };
  for (int column = 0; column < camera.width; ++column) see(column, 0);
  for (int row = 0; row < camera.height; ++row) see(0, row);
  return reach;
}

}  // namespace

Place pixel_place(const CameraModel& camera, double column, double row) noexcept {
  const double cx = (camera.width - 1) / 2.0;
  const double cy = (camera.height - 1) / 2.0;
  const double dx = column - cx;
  const double dy = row - cy;
  const double radius2 = (dx * dx + dy * dy) / (cx * cx + cy * cy);
  const double scale = camera.mm_per_px * (1 + camera.barrel * radius2);
  return {dx * scale, dy * scale};
}

Grid make_grid(const Scene& scene) {
  Grid grid;
  grid.spacing_mm = scene.gel.grid_mm;
  const Place reach = reach_of(scene);
  const double margin = 2 * kMargin * scene.gel.thickness_mm;
  const auto side = [&](double field_mm) {
    return cv::getOptimalDFTSize(
        static_cast<int>(std::ceil((field_mm + margin) / grid.spacing_mm)));
  };
  grid.width = side(2 * reach.x_mm);
  grid.height = side(2 * reach.y_mm);
  // Whole points to the left of and above the centre: an object at the origin is sampled the same
  // way for every size of image.
  const int left = grid.width / 2;
  const int above = grid.height / 2;
  grid.x0_mm = -left * grid.spacing_mm;
  grid.y0_mm = -above * grid.spacing_mm;
  return grid;
}

Perspective::Perspective(const SurfaceModel& surface, const Grid& grid)
    : grid_(grid), leans_(grid.size()), seen_(grid.size()) {
  constexpr double kStep = 0.5;  // mm
  const double camera = surface.camera_mm;
  std::size_t i = 0;
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column, ++i) {
      const double x = grid.x0_mm + column * grid.spacing_mm;
      const double y = grid.y0_mm + row * grid.spacing_mm;
      seen_[i] = {static_cast<float>(column), static_cast<float>(row)};
      const cv::Vec3d at = point_at(surface, {x, y}).at;
      // Beyond the field rays need not meet the surface.
      if (camera == 0 || at[2] < -0.7 * camera) continue;
      const double widens = camera / (camera + at[2]);
      const auto moved = unrolled(surface, {widens * at[0], widens * at[1]}, kStep);
      const double across = (moved.x_mm - x) / kStep / grid.spacing_mm;
      const double down = (moved.y_mm - y) / kStep / grid.spacing_mm;
      if (std::isnan(across) || std::isnan(down)) continue;
      leans_[i] = {static_cast<float>(across), static_cast<float>(down)};
    }
  }
}

std::size_t Perspective::corner(float& column, float& row) const noexcept {
  const float c = std::clamp(column, 0.0F, static_cast<float>(grid_.width) - 1.001F);
  const float r = std::clamp(row, 0.0F, static_cast<float>(grid_.height) - 1.001F);
  const auto left = static_cast<std::size_t>(c);
  const auto top = static_cast<std::size_t>(r);
  column = c - static_cast<float>(left);
  row = r - static_cast<float>(top);
  return top * static_cast<std::size_t>(grid_.width) + left;
}

void Perspective::follow(std::span<const std::int16_t> indentation, double per_mm) noexcept {
  const auto width = static_cast<std::size_t>(grid_.width);
  const auto unit = static_cast<float>(1 / per_mm);
  const auto depth_at = [&](float column, float row) {
    const std::size_t i = corner(column, row);
    const auto value = [&](std::size_t at) { return static_cast<float>(indentation[at]); };
    return unit * std::lerp(std::lerp(value(i), value(i + 1), column),
                            std::lerp(value(i + width), value(i + width + 1), column), row);
  };
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    const std::size_t x = i % width;
    const std::size_t y = i / width;
    const auto column = static_cast<float>(x);
    const auto row = static_cast<float>(y);
    const Place lean = leans_[i];
    // The depth at which the ray meets the gel: a zero of depth(place) − d, by the secant method.
    const auto above = [&](float d) {
      return depth_at(column + lean.column * d, row + lean.row * d) - d;
    };
    float d0 = 0;
    float f0 = unit * static_cast<float>(indentation[i]);
    float d1 = f0;
    constexpr float kClose = 1e-5F;  // mm
    for (int step = 0; step < 6 && d1 != d0; ++step) {
      const float f1 = above(d1);
      if (std::abs(f1) < kClose || f1 == f0) break;
      const float next = d1 - f1 * (d1 - d0) / (f1 - f0);
      d0 = std::exchange(d1, next);
      f0 = f1;
    }
    seen_[i] = {column + lean.column * d1, row + lean.row * d1};
  }
}

void Perspective::read(std::span<const std::int16_t> values,
                       std::span<std::int16_t> out) const noexcept {
  const auto width = static_cast<std::ptrdiff_t>(grid_.width);
  // Catmull and Rom's cubic, which blurs less than a straight line.
  const auto weights = [](float t) {
    return std::array<float, 4>{((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2,
                                ((4 - 3 * t) * t + 1) * t / 2, (t - 1) * t * t / 2};
  };
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    float column = seen_[i].column;
    float row = seen_[i].row;
    const std::size_t own_column = i % static_cast<std::size_t>(width);
    const std::size_t own_row = i / static_cast<std::size_t>(width);
    if (column == static_cast<float>(own_column) && row == static_cast<float>(own_row)) {
      out[i] = values[i];
      continue;
    }
    const auto at = static_cast<std::ptrdiff_t>(corner(column, row));
    const auto left = at % width;
    const auto top = at / width;
    const std::array<float, 4> across = weights(column);
    const std::array<float, 4> down = weights(row);
    float sum = 0;
    for (std::ptrdiff_t k = 0; k < 4; ++k) {
      const auto y = std::clamp<std::ptrdiff_t>(top + k - 1, 0, grid_.height - 1);
      float line = 0;
      for (std::ptrdiff_t m = 0; m < 4; ++m) {
        const auto x = std::clamp<std::ptrdiff_t>(left + m - 1, 0, width - 1);
        line += across[static_cast<std::size_t>(m)] *
                static_cast<float>(values[static_cast<std::size_t>(y * width + x)]);
      }
      sum += down[static_cast<std::size_t>(k)] * line;
    }
    out[i] = static_cast<std::int16_t>(std::clamp(std::lround(sum), -32768L, 32767L));
  }
}

PixelMap::PixelMap(const CameraModel& camera, const SurfaceModel& surface, const Grid& grid)
    : width_(static_cast<std::size_t>(camera.width)), pitch_(static_cast<std::size_t>(grid.width)) {
  entries_.reserve(width_ * static_cast<std::size_t>(camera.height));
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const Place place = unrolled(surface, pixel_place(camera, column, row));
      // Q8 positions, so that the split into point and weight is one integer division.
      const auto x = static_cast<std::uint32_t>(
          std::lround((place.x_mm - grid.x0_mm) / grid.spacing_mm * 256));
      const auto y = static_cast<std::uint32_t>(
          std::lround((place.y_mm - grid.y0_mm) / grid.spacing_mm * 256));
      Entry entry;
      entry.index = y / 256 * static_cast<std::uint32_t>(grid.width) + x / 256;
      entry.fx = static_cast<std::uint16_t>(x % 256);
      entry.fy = static_cast<std::uint16_t>(y % 256);
      entries_.push_back(entry);
    }
  }
}

void PixelMap::sample_row(int row, std::span<const std::int16_t> grid_values,
                          std::span<std::int16_t> out) const noexcept {
  const Entry* const entries = entries_.data() + static_cast<std::size_t>(row) * width_;
  const std::int16_t* const values = grid_values.data();
  for (std::size_t i = 0; i < width_; ++i) {
    const Entry entry = entries[i];
    const std::int16_t* const upper = values + entry.index;
    const std::int16_t* const lower = upper + pitch_;
    const std::int32_t top = upper[0] * 256 + (upper[1] - upper[0]) * entry.fx;
    const std::int32_t bottom = lower[0] * 256 + (lower[1] - lower[0]) * entry.fx;
    // Q16 would overflow by one bit; Q12 keeps more than the values have.
    const std::int32_t t = top >> 4;
    const std::int32_t b = bottom >> 4;
    out[i] = static_cast<std::int16_t>((t + (((b - t) * entry.fy) >> 8) + (1 << 3)) >> 4);
  }
}

}  // namespace dtact::hal::sim
