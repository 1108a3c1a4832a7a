#pragma once

#include <cstdint>

namespace dtact::recon {

/// A pixel of the camera frame, or a place on the surface in millimetres.
struct Point {
  double x = 0;
  double y = 0;

  [[nodiscard]] bool operator==(const Point&) const = default;
};

/// Where the camera stands above a plane surface. A depth map's pixels are places of the
/// undeformed surface: a point that is pressed in lies nearer to the camera and therefore appears
/// farther from the foot of the camera's axis than it is.
struct Viewpoint {
  Point foot_mm;      ///< Foot of the camera's axis on the surface.
  double per_mm = 0;  ///< 1 / the camera's effective height above it; 0: unknown, no correction.

  /// The place of a point that appears at `seen` (millimetres) and is pressed in by `depth_mm`.
  [[nodiscard]] constexpr Point place(Point seen, double depth_mm) const noexcept {
    const double share = per_mm * depth_mm;
    return {seen.x - share * (seen.x - foot_mm.x), seen.y - share * (seen.y - foot_mm.y)};
  }

  /// Where a point at `place` appears that is pressed in by `depth_mm`.
  [[nodiscard]] constexpr Point seen(Point place, double depth_mm) const noexcept {
    const double rest = 1 - per_mm * depth_mm;
    return {foot_mm.x + (place.x - foot_mm.x) / rest, foot_mm.y + (place.y - foot_mm.y) / rest};
  }

  [[nodiscard]] bool operator==(const Viewpoint&) const = default;
};

/// The undeformed gel's outer surface, in the surface frame: origin where the camera's axis leaves
/// it, z away from the camera. Indentation is measured from it, along its normal.
struct Surface {
  enum class Kind : std::uint8_t {
    plane,
    sphere,   ///< Bulging towards the object, centre at (0, 0, −radius).
    cylinder  ///< The same about an axis in the plane z = −radius.
  };
  Kind kind = Kind::plane;

  // Of a curved one.
  double radius_mm = 0;
  double axis_deg = 0;  ///< a cylinder's axis direction, from x towards y
  /// The camera looks along z through air and then through the flat back of the gel.
  double air_mm = 0;      ///< From the camera's pinhole to the gel.
  double gel_mm = 0;      ///< From there to the surface's origin.
  double refraction = 1;  ///< the gel's; the air's is 1

  Viewpoint view = {};  ///< Of a plane, in the surface frame.

  [[nodiscard]] bool operator==(const Surface&) const = default;
};

/// What a Surface may be, in a calibration and on the wire.
struct SurfaceLimits {
  static constexpr double kMinRadiusMm = 1;
  static constexpr double kMaxRadiusMm = 10000;
  static constexpr double kMinDistanceMm = 0.01;  ///< through air and gel on the camera's axis
  static constexpr double kMaxDistanceMm = 1000;
  static constexpr double kMaxRefraction = 3;  ///< From 1.
  static constexpr double kMaxPerMm = 0.2;     ///< Of a Viewpoint: 5 mm above the surface.
  static constexpr double kMaxFootMm = 100;    ///< Either way from the map's centre.
};

}  // namespace dtact::recon
