#pragma once

#include <array>
#include <optional>
#include <vector>

#include "clients/geometry/vector.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::perceive {

/// A point of the undeformed surface and the outward unit normal there.
struct SurfacePoint {
  Vector point = {};  ///< Metres.
  Vector normal = {};
  /// Direction of the camera ray there, as long as 1 along the normal: the point that is seen there
  /// and pressed in by d is at point − d · ray.
  Vector ray = {};
};

/// Where the camera ray leaves the gel that crosses the plane z = 0 at (x, y), in millimetres: what
/// a depth map's pixel means, since a lens is calibrated on that plane. The ray is refracted where
/// it enters the gel's flat back (Snell's law). Nothing where it passes beside the surface.
[[nodiscard]] std::optional<SurfacePoint> cast_ray(const recon::Surface& surface, double x_mm,
                                                   double y_mm);

/// The surface at each pixel of a whole depth map, row-major; NaN where no ray meets it. Made once
/// for a map's size, so that a curved surface costs no rays per frame.
struct SurfaceTable {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::array<std::vector<float>, 3> point;  ///< x, y, z; metres.
  std::array<std::vector<float>, 3> normal;
  std::array<std::vector<float>, 3> ray;
};
[[nodiscard]] SurfaceTable make_surface_table(const recon::Surface& surface, int width, int height,
                                              double mm_per_px);

/// The place of a depth map whose ray goes through a point, above or below the surface.
struct SurfaceProjection {
  double column = 0;  ///< In the whole map; fractional.
  double row = 0;
  Vector normal = {};  ///< Normal of the undeformed surface; length 1 before interpolation.
};
/// Inverts a table for points (metres) much nearer to the surface than its radius of curvature.
/// Accurate to a fiftieth of a pixel. Nothing for a point outside the table.
[[nodiscard]] std::optional<SurfaceProjection> project_to_surface(const SurfaceTable& table,
                                                                  const Vector& point);

}  // namespace dtact::perceive
