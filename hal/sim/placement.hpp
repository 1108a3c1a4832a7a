#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "hal/sim/grid.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Pose of a rigid object: its point p, in its own frame (Object), is at turn · p + (x, y, z) in
/// the sensor's frame. Its origin is the image's centre on the undeformed surface, x to the
/// right, y down, z away from the camera; right-handed, the wire's surface frame. An upright object
/// whose lowest point is its origin, pressed d deep, has z = −d.
struct Pose {
  double x_mm = 0;
  double y_mm = 0;
  double z_mm = 0;
  /// Rotation vector in the sensor's axes: its direction is the axis, its length the angle, 0 … 180
  /// degrees, right-handed.
  std::array<double, 3> turn_deg{};
};

/// The rotation matrix of a rotation vector in degrees.
[[nodiscard]] cv::Matx33d rotation_of(const std::array<double, 3>& turn_deg);

/// Where the keys of `press` put its object at `time_s`; nothing before the first one.
[[nodiscard]] std::optional<PressKey> key_at(const Press& press, double time_s);

/// The pose at a key. On a curved surface a key refers to the tangent plane at the
/// key's position. Its axes are the sensor's after the shortest turn to the surface's normal there.
/// The lowest point of a tilted object, `depth_mm` below that plane, is searched for on
/// its surface: within 0.01 mm, and the returned pose is exact.
[[nodiscard]] Pose pose_of(const SurfaceModel& surface, const Object& object, const PressKey& key);

/// Raises `target` (grid sized, mm below the undeformed surface) to the indentation that `object`
/// at `key` requires: its greatest depth on the surface's normal through each point. Unless
/// it stands upright on a plane, the normal is followed up to `highest_mm` above the undeformed
/// surface in steps of a quarter of the grid's spacing, and the crossing found by bisection.
void lower_object(const SurfaceModel& surface, const Object& object, const PressKey& key,
                  double highest_mm, const Grid& grid, cv::Mat1d& target);

}  // namespace dtact::hal::sim
