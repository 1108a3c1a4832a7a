#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace dtact::recon {

/// Heights of a surface on a square grid in x and y whose middle is the surface frame's origin, as
/// proto's HeightMap has them.
struct SurfaceHeights {
  int width = 0;  ///< Nodes.
  int height = 0;
  double spacing_mm = 0;
  std::vector<std::int32_t> z_um;  ///< Row by row; towards the object is positive.

  bool operator==(const SurfaceHeights&) const = default;
};

/// The untouched gel's outer surface, in the surface frame: origin where the camera's axis leaves
/// it, z away from the camera. Indentation is measured from it, along its normal.
struct Surface {
  enum class Kind : std::uint8_t {
    plane,
    sphere,     ///< Bulging towards the object, centre at (0, 0, −radius).
    cylinder,   ///< The same about an axis in the plane z = −radius.
    height_map  ///< Any other that the camera sees once.
  };
  Kind kind = Kind::plane;

  // All that follows says nothing of a plane.
  double radius_mm = 0;
  double axis_deg = 0;  ///< Of a cylinder: its axis' direction, from x towards y.
  /// The camera looks along z through air and then through the flat back of the gel.
  double air_mm = 0;      ///< From the camera's pinhole to the gel.
  double gel_mm = 0;      ///< From there to the surface's origin.
  double refraction = 1;  ///< Of the gel; the air's is 1.

  /// Of a height map alone. Shared, so that a frame's copy of the surface allocates nothing.
  std::shared_ptr<const SurfaceHeights> heights = {};

  [[nodiscard]] bool operator==(const Surface& other) const {
    const bool same_heights =
        heights == other.heights || (heights && other.heights && *heights == *other.heights);
    return same_heights && kind == other.kind && radius_mm == other.radius_mm &&
           axis_deg == other.axis_deg && air_mm == other.air_mm && gel_mm == other.gel_mm &&
           refraction == other.refraction;
  }
};

/// What a Surface may be, in a calibration and on the wire.
struct SurfaceLimits {
  static constexpr double kLeastRadiusMm = 1;
  static constexpr double kMostRadiusMm = 10000;
  static constexpr double kLeastDistanceMm = 0.01;  ///< Of air and of gel on the camera's axis.
  static constexpr double kMostDistanceMm = 1000;
  static constexpr double kMostRefraction = 3;  ///< From 1.
  // Of heights.
  static constexpr int kLeastNodes = 4;  ///< Along each side.
  static constexpr int kMostNodes = 64;
  static constexpr double kLeastSpacingMm = 0.05;
  static constexpr double kMostSpacingMm = 20;
  static constexpr double kMostHeightMm = 100;  ///< To both sides of 0.
  /// From a node to its neighbour, 72°: a camera that looks along z hardly sees what is steeper.
  static constexpr double kMostSlope = 3;
};

}  // namespace dtact::recon
