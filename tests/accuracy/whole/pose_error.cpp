#include "tests/accuracy/whole/pose_error.hpp"

#include <Eigen/SVD>
#include <cmath>
#include <cstddef>

namespace dtact::whole {
namespace {

using Twist = Eigen::Matrix<double, 6, 1>;

/// The one twist about `centre` (rotation times `arm`) that leads to `motion` when followed for a
/// time.
Twist screw_of(const Eigen::Isometry3d& motion, const Eigen::Vector3d& centre, double arm) {
  const Eigen::AngleAxisd turn(motion.rotation());
  const Eigen::Vector3d shift = motion * centre - centre;
  Twist twist;
  twist.head<3>() = arm * turn.angle() * turn.axis();
  // The inverse of the left Jacobian of SO(3): Barfoot, State Estimation for Robotics, 7.1.3.
  const double half = turn.angle() / 2;
  const double cotangent = half < 1e-6 ? 1 : half / std::tan(half);
  twist.tail<3>() = cotangent * shift + (1 - cotangent) * turn.axis() * turn.axis().dot(shift) -
                    half * turn.axis().cross(shift);
  return twist;
}

/// The same direction about another centre and arm, not of unit length.
Twist about(const Direction& direction, const Eigen::Vector3d& centre, double arm) {
  const Eigen::Vector3d rotation = direction.twist.head<3>() / direction.arm;
  Twist twist;
  twist.head<3>() = arm * rotation;
  twist.tail<3>() = direction.twist.tail<3>() + rotation.cross(centre - direction.centre);
  return twist;
}

}  // namespace

Direction carried(const Direction& direction, const Eigen::Isometry3d& motion) {
  Direction moved = direction;
  moved.centre = motion * direction.centre;
  moved.twist.head<3>() = motion.linear() * direction.twist.head<3>();
  moved.twist.tail<3>() = motion.linear() * direction.twist.tail<3>();
  return moved;
}

PoseError error_of(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                   const Eigen::Vector3d& centre, double arm,
                   const std::vector<Direction>& without) {
  Twist off = screw_of(found * truth.inverse(), centre, arm);
  if (!without.empty()) {
    Eigen::Matrix<double, 6, Eigen::Dynamic> span(6, std::ssize(without));
    for (std::size_t i = 0; i < without.size(); ++i) {
      span.col(static_cast<Eigen::Index>(i)) = about(without[i], centre, arm).normalized();
    }
    // A direction that was found in several frames differs slightly between them.
    constexpr double kAlike = 0.3;
    const Eigen::JacobiSVD<decltype(span)> svd(span, Eigen::ComputeFullU);
    for (Eigen::Index i = 0; i < svd.singularValues().size(); ++i) {
      const Twist direction = svd.matrixU().col(i);
      if (svd.singularValues()[i] > kAlike) off -= direction * direction.dot(off);
    }
  }
  return {off.tail<3>().norm(), off.head<3>().norm() / arm * 180 / M_PI};
}

}  // namespace dtact::whole
