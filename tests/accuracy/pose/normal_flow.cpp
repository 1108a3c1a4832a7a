#include "tests/accuracy/pose/normal_flow.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <utility>

namespace dtact::pose {
namespace {

using Eigen::Vector3d;
using perceive::ContactView;
using perceive::Motion;

/// Every second pixel of the map of 580 × 580 along both sides: sensors that it was made for have
/// 320 × 240.
constexpr int kStride = 2;
constexpr int kMostSteps = 50;
constexpr double kConverged = 1e-7;  // radians, metres
/// Where less is shared, or normals differ by more, the frame before becomes the reference; where
/// that does not help, the track is lost.
constexpr double kShared = 0.6;
constexpr double kDifferDeg = 12;
/// Keeps what the normals do not show where it is.
constexpr double kDamping = 1e-6;

Motion after(const Motion& first, const Motion& then) {
  return {then.rotation * first.rotation, then.rotation * first.translation + then.translation};
}

Motion back(const Motion& motion) {
  return {motion.rotation.transpose(), -motion.rotation.transpose() * motion.translation};
}

Eigen::Matrix3d cross_of(const Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

NormalFlow::Reference NormalFlow::reference_of(const perceive::DepthGrid& depth,
                                               const perceive::PointCloud& cloud,
                                               const ContactView& view) {
  Reference reference;
  // The same pixels of the whole map in every frame.
  for (int row = depth.y % kStride; row < cloud.height; row += kStride) {
    for (int column = depth.x % kStride; column < cloud.width; column += kStride) {
      const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(cloud.width) +
                     static_cast<std::size_t>(column);
      const Vector3d point(cloud.part(perceive::PointCloud::kX)[i],
                           cloud.part(perceive::PointCloud::kY)[i],
                           cloud.part(perceive::PointCloud::kZ)[i]);
      if (!cloud.has(i)) continue;
      const auto sample = view.at(point);
      if (!sample) continue;
      reference.points.push_back(point);
      reference.normals.push_back(sample->normal);
    }
  }
  return reference;
}

NormalFlow::Fit NormalFlow::fit(const Reference& reference, const ContactView& view,
                                const Motion& start) {
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  Fit fit{start};
  // Metres count as radians at this length, as in a contact of some millimetres.
  constexpr double kLength = 2e-3;
  double rise = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& point : reference.points) centre += fit.motion * point;
    centre /= static_cast<double>(reference.points.size());
    Matrix5 matrix = Matrix5::Zero();
    Vector5 vector = Vector5::Zero();
    double squares = 0;
    std::size_t count = 0;
    rise = 0;
    for (std::size_t i = 0; i < reference.points.size(); ++i) {
      const Vector3d point = fit.motion * reference.points[i];
      const auto sample = view.at(point);
      if (!sample) continue;
      const Vector3d turned = fit.motion.rotation * reference.normals[i];
      const Vector3d residual = sample->normal - turned;
      rise += sample->point.z() - point.z();
      squares += residual.squaredNorm();
      ++count;
      if (!sample->bend) continue;
      // How the frame's normal changes along x and y; its third part follows from its length.
      Eigen::Matrix<double, 3, 2> bend;
      bend.topRows<2>() = sample->bend->change.leftCols<2>();
      bend.row(2) =
          -(sample->normal.head<2>().transpose() * bend.topRows<2>()) / sample->normal.z();
      Eigen::Matrix<double, 3, 5> rows;
      rows.leftCols<3>() = -bend * cross_of(point - centre).topRows<2>() + cross_of(turned);
      rows.rightCols<2>() = bend * kLength;
      matrix += rows.transpose() * rows;
      vector -= rows.transpose() * residual;
    }
    fit.shared = static_cast<double>(count) / static_cast<double>(reference.points.size());
    if (count < 12) return fit;
    rise /= static_cast<double>(count);
    fit.differ_deg = std::sqrt(squares / static_cast<double>(count)) * 180 / M_PI;
    matrix.diagonal().array() += kDamping * static_cast<double>(count);
    const Vector5 change = matrix.ldlt().solve(vector);
    const Vector3d turn = change.head<3>();
    const double angle = turn.norm();
    const Eigen::Matrix3d rotation = angle > 0
                                         ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix()
                                         : Eigen::Matrix3d::Identity();
    const Vector3d slide(change[3] * kLength, change[4] * kLength, rise);
    fit.motion.rotation = rotation * fit.motion.rotation;
    fit.motion.translation = rotation * (fit.motion.translation - centre) + centre + slide;
    if (change.norm() < kConverged / kLength && std::abs(rise) < kConverged) break;
  }
  return fit;
}

const NormalFlow::Pose& NormalFlow::follow(const perceive::DepthGrid& depth,
                                           const perceive::PointCloud& cloud,
                                           const ContactView& view) {
  Reference now = reference_of(depth, cloud, view);
  if (now.points.empty()) {
    pose_.lost = true;
    return pose_;
  }
  if (reference_.points.empty()) {
    reference_ = before_ = std::move(now);
    return pose_;
  }
  const auto good = [](const Fit& fit) {
    return fit.shared >= kShared && fit.differ_deg <= kDifferDeg;
  };
  Fit found = fit(reference_, view, after(back(reference_.motion), pose_.motion));
  if (!good(found)) {
    reference_ = before_;
    found = fit(reference_, view, after(back(reference_.motion), pose_.motion));
  }
  pose_.lost = !good(found);
  if (pose_.lost) return pose_;
  pose_.motion = after(reference_.motion, found.motion);
  now.motion = pose_.motion;
  before_ = std::move(now);
  return pose_;
}

}  // namespace dtact::pose
