#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>

namespace dtact::hal::sim {

enum class SurfaceShape : std::uint8_t { plane, sphere, cylinder };

/// The undeformed surface. On a curved one the apex, where the camera's axis meets it, is the
/// origin of the sensor's frame (Pose), and the surface curves away from there towards the camera.
/// A cylinder's axis lies along x.
struct SurfaceModel {
  SurfaceShape shape = SurfaceShape::plane;
  double radius_mm = 0;
  /// How far behind the apex the camera's rays start: of a curved one at most the radius, of a
  /// plane 0 for rays that are all along z.
  double camera_mm = 0;
};

/// A place on the gel, mm from the image's centre: x to the right and y down on a plane. On a
/// curved surface it is unrolled: along a cylinder's axis and the arc across it; on a sphere the
/// arc from the apex, in the direction in which it leaves it.
struct Place {
  double x_mm = 0;
  double y_mm = 0;
};

/// A point of the undeformed surface in the sensor's frame. Pressed d deep it moves to at − d
/// normal.
struct SurfacePoint {
  cv::Vec3d at;      ///< mm
  cv::Vec3d normal;  ///< Outward, length 1.
  /// The shortest turn that takes the z axis to the normal, as a rotation vector (Pose).
  std::array<double, 3> turn_deg{};
};

/// Intersection of the surface with the straight line from the camera through `seen`, a position
/// on the tangent plane in the apex, where it is pressed in by `depth_mm` along its normals. It
/// needs no refraction: camera_mm is where rays seem to start inside the gel.
[[nodiscard]] Place unrolled(const SurfaceModel& surface, const Place& seen,
                             double depth_mm = 0) noexcept;

[[nodiscard]] SurfacePoint point_at(const SurfaceModel& surface, const Place& place);

}  // namespace dtact::hal::sim
