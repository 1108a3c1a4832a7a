#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "daemon/recon/rectify.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::recon {

/// Maps a point of the undeformed surface into the camera frame: a pinhole camera that looks
/// at a plane, with radial distortion about its own centre (the even terms of Brown 1966; OpenCV's
/// model with square pixels and without tangential terms). With h = homography · (x, y, 1),
/// q = (h₀, h₁) / h₂ and ρ = |q − centre| / radius_px, the pixel is
///
///     centre + (q − centre) · (1 + k₁ρ² + k₂ρ⁴ + …).
struct Lens {
  /// Row-major; millimetres on the surface to undistorted pixels.
  std::array<double, 9> homography = {};
  double centre_col = 0;       ///< Centre of distortion, pixels.
  double centre_row = 0;       ///< Centre of distortion, pixels.
  double radius_px = 1;        ///< Where ρ is 1, pixels.
  std::vector<double> radial;  ///< k₁, k₂, …; at most kMaxRadial.

  static constexpr std::size_t kMaxRadial = 6;
};

/// The pixel (column, row) at which the surface's point appears. NaN beyond the distance from the
/// centre at which the distortion folds back on itself, and behind the camera.
[[nodiscard]] Point project(const Lens& lens, Point mm);

/// Millimetres a camera pixel spans about the surface's origin: the square root of its area.
[[nodiscard]] double central_mm_per_px(const Lens& lens);

/// The foot of the camera's axis on the surface, millimetres: what the homography shows at the
/// centre of distortion, were it without perspective.
[[nodiscard]] Point axis_foot(const Lens& lens);

/// Throws std::invalid_argument unless the surface's origin is seen in a frame of this size,
/// upright and not mirrored.
void check(const Lens& lens, int frame_width, int frame_height);

/// Position of the depth map in the rectified image. That has the scale mm_per_px everywhere, x
/// to the right and y down. It shows the surface's origin at the same pixel as the frame.
struct MapPlace {
  int col = 0;  ///< Upper left corner in the rectified image, pixels.
  int row = 0;
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
};

/// The surface's point at a (fractional) pixel of the depth map.
[[nodiscard]] Point surface_point(const Lens& lens, const MapPlace& place, double x, double y);
/// The (fractional) pixel of the depth map that shows a point of the surface, millimetres.
[[nodiscard]] Point map_pixel(const Lens& lens, const MapPlace& place, Point mm);

/// Evaluates the lens at each pixel of the depth map, to 1/128 pixel. Where the frame does not show
/// a pixel, `outside` (depth-map sized) is 1 and the entry is a place at the frame's edge. Throws
/// std::invalid_argument when the place is empty, or as check().
[[nodiscard]] RectifyTable make_lens_table(const Lens& lens, int frame_width, int frame_height,
                                           const MapPlace& place,
                                           std::vector<std::uint8_t>& outside);

}  // namespace dtact::recon
