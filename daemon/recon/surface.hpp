#pragma once

#include <cstdint>

namespace dtact::recon {

/// The undeformed gel's outer surface, in the surface frame: origin where the camera's axis leaves
/// it, z away from the camera. Indentation is measured from it, along its normal.
struct Surface {
  enum class Kind : std::uint8_t {
    plane,
    sphere,   ///< Bulging towards the object, centre at (0, 0, −radius).
    cylinder  ///< The same about an axis in the plane z = −radius.
  };
  Kind kind = Kind::plane;

  // All that follows says nothing of a plane.
  double radius_mm = 0;
  double axis_deg = 0;  ///< a cylinder's axis direction, from x towards y
  /// The camera looks along z through air and then through the flat back of the gel.
  double air_mm = 0;      ///< From the camera's pinhole to the gel.
  double gel_mm = 0;      ///< From there to the surface's origin.
  double refraction = 1;  ///< the gel's; the air's is 1

  [[nodiscard]] bool operator==(const Surface&) const = default;
};

/// What a Surface may be, in a calibration and on the wire.
struct SurfaceLimits {
  static constexpr double kMinRadiusMm = 1;
  static constexpr double kMaxRadiusMm = 10000;
  static constexpr double kMinDistanceMm = 0.01;  ///< through air and gel on the camera's axis
  static constexpr double kMaxDistanceMm = 1000;
  static constexpr double kMaxRefraction = 3;  ///< From 1.
};

}  // namespace dtact::recon
