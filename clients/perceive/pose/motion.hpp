#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace dtact::perceive {

/// A rigid motion or a pose: maps p to linear() · p + translation(). Metres, surface
/// frame.
using Motion = Eigen::Isometry3d;

/// A small motion about a centre: rotation (radians times an arm in metres), then translation
/// (metres), so that all six components are lengths.
using Twist = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// The rotation of `angle` = |turn| radians about `turn`.
[[nodiscard]] inline Eigen::Matrix3d rotation_by(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

}  // namespace dtact::perceive
