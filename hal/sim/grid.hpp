#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// The points on which contact is solved; those of a curved gel unrolled (Place). Point
/// (column, row) is at x = x0_mm + column·spacing, y = y0_mm + row·spacing from the image's centre.
struct Grid {
  int width = 0;
  int height = 0;
  double spacing_mm = 0;
  double x0_mm = 0;
  double y0_mm = 0;

  [[nodiscard]] std::size_t size() const noexcept {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
};

/// Covers the camera's field and several thicknesses around it, so that the periodic solution has
/// a free border; sides are lengths the FFT likes.
[[nodiscard]] Grid make_grid(const Scene& scene);

/// Position of pixel (column, row) on the gel, including the lens; for a curved gel on the tangent
/// plane in its apex.
[[nodiscard]] Place pixel_place(const CameraModel& camera, double column, double row) noexcept;

/// What the camera sees of a deformed gel, on the grid: at each point the gel that appears where
/// the undeformed gel's point does. One thread at a time.
class Perspective {
 public:
  Perspective(const SurfaceModel& surface, const Grid& grid);

  /// Finds the rays' places on a gel of this indentation (grid sized, `per_mm` units a millimetre).
  void follow(std::span<const std::int16_t> indentation, double per_mm) noexcept;
  /// Reads grid-sized values at those places.
  void read(std::span<const std::int16_t> values, std::span<std::int16_t> out) const noexcept;

 private:
  struct Place {
    float column = 0;
    float row = 0;
  };
  [[nodiscard]] std::size_t corner(float& column, float& row) const noexcept;

  Grid grid_;
  std::vector<Place> leans_;  // grid points by which a ray moves for each millimetre of depth
  std::vector<Place> seen_;   // of each point, grid points
};

/// For every pixel the four grid points around the place that it shows. Bilinear, in Q8.
class PixelMap {
 public:
  PixelMap(const CameraModel& camera, const SurfaceModel& surface, const Grid& grid);

  /// Reads `grid_values` (grid sized) at the pixels of one image row.
  void sample_row(int row, std::span<const std::int16_t> grid_values,
                  std::span<std::int16_t> out) const noexcept;

 private:
  struct Entry {
    std::uint32_t index = 0;  // upper left grid point
    std::uint16_t fx = 0;     // weight of the right column, 0 … 255
    std::uint16_t fy = 0;     // weight of the lower row, 0 … 255
  };
  std::size_t width_;
  std::size_t pitch_;
  std::vector<Entry> entries_;
};

}  // namespace dtact::hal::sim
