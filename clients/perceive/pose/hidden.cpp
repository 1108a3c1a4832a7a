#include "clients/perceive/pose/hidden.hpp"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace dtact::perceive {
namespace {

using Eigen::Vector3d;

/// What a twist's rotation is about, and what makes a length of it.
struct Frame {
  Vector3d centre;
  double arm = 0;
};

/// The same motion as a twist of another frame.
Twist seen_from(const Twist& twist, const Frame& from, const Frame& to) {
  const Vector3d turn = twist.head<3>() / from.arm;
  Twist seen;
  seen << to.arm * turn, twist.tail<3>() + turn.cross(to.centre - from.centre);
  return seen;
}

Twist turned(const Eigen::Matrix3d& rotation, const Twist& twist) {
  Twist result;
  result << rotation * twist.head<3>(), rotation * twist.tail<3>();
  return result;
}

}  // namespace

bool Hidden::add(const std::vector<Twist>& twists, const Alignment& at) {
  const Motion& motion = at.motion;
  if (twists_.empty()) {
    centre_ = motion.inverse() * at.centre;
    arm_ = at.arm;
  }
  bool more = false;
  for (const Twist& one : twists) {
    const Twist there = seen_from(one, {at.centre, at.arm}, {motion * centre_, arm_});
    Twist back = turned(motion.rotation.transpose(), there);
    for (const Twist& known : twists_) back -= known * known.dot(back);
    constexpr double kAnother = 0.3;
    if (back.norm() < kAnother * there.norm()) continue;
    twists_.push_back(back.normalized());
    more = true;
  }
  return more;
}

std::vector<Twist> Hidden::seen_at(const Alignment& at) const {
  std::vector<Twist> seen;
  seen.reserve(twists_.size());
  for (const Twist& one : twists_) {
    seen.push_back(seen_from(turned(at.motion.rotation, one), {at.motion * centre_, arm_},
                             {at.centre, at.arm}));
  }
  return seen;
}

std::vector<Twist> seen_from(const std::vector<Twist>& twists, const Alignment& from,
                             const Alignment& to) {
  std::vector<Twist> seen;
  seen.reserve(twists.size());
  for (const Twist& one : twists) {
    seen.push_back(seen_from(one, {from.centre, from.arm}, {to.centre, to.arm}));
  }
  return seen;
}

std::vector<Twist> in_both(const std::vector<Twist>& a, const std::vector<Twist>& b) {
  if (a.empty() || b.empty()) return {};
  // The principal angles between the two.
  const auto columns = [](const std::vector<Twist>& twists) {
    Eigen::MatrixXd matrix(6, twists.size());
    for (std::size_t i = 0; i < twists.size(); ++i) {
      matrix.col(static_cast<Eigen::Index>(i)) = twists[i];
    }
    return matrix;
  };
  const Eigen::MatrixXd all = columns(a);
  const Eigen::MatrixXd base = Eigen::HouseholderQR<Eigen::MatrixXd>(columns(b)).householderQ() *
                               Eigen::MatrixXd::Identity(6, static_cast<Eigen::Index>(b.size()));
  const Eigen::JacobiSVD<Eigen::MatrixXd> angles(all.transpose() * base, Eigen::ComputeThinU);
  constexpr double kCommon = 0.9;
  std::vector<Twist> common;
  for (Eigen::Index k = 0; k < angles.singularValues().size(); ++k) {
    if (angles.singularValues()[k] > kCommon) common.emplace_back(all * angles.matrixU().col(k));
  }
  return common;
}

}  // namespace dtact::perceive
