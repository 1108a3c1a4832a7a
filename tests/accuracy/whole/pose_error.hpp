#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace dtact::whole {

// Lengths are millimetres, poses are in the surface frame.

/// A direction of motion as on the wire: a unit twist about `centre`, its rotation times `arm`.
struct Direction {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double arm = 1;
  Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();  ///< Rotation first.
};
/// The direction on an object that has moved by `motion`.
[[nodiscard]] Direction carried(const Direction& direction, const Eigen::Isometry3d& motion);

/// Error of an estimated motion against the true one, split at the contact's centre.
struct PoseError {
  double mm = 0;
  double deg = 0;
};
/// Without its part along `without`. `centre` and `arm` are the contact's.
[[nodiscard]] PoseError error_of(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                                 const Eigen::Vector3d& centre, double arm,
                                 const std::vector<Direction>& without);

}  // namespace dtact::whole
