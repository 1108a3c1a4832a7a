#include "hal/sim/grid.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

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
