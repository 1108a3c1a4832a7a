#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "clients/perceive/pose/contact_view.hpp"

namespace dtact::perceive {

/// A rigid motion: p lies at rotation · p + translation after it. Metres.
struct Motion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& p) const {
    return rotation * p + translation;
  }
  /// `first`, and then this one.
  [[nodiscard]] Motion operator*(const Motion& first) const {
    return {rotation * first.rotation, *this * first.translation};
  }
  [[nodiscard]] Motion inverse() const {
    return {rotation.transpose(), -(rotation.transpose() * translation)};
  }
};

/// A small motion about Alignment::centre: rotation (radians times Alignment::arm, metres), then
/// translation (metres).
using Twist = Eigen::Matrix<double, 6, 1>;

/// The one twist about `centre`, its rotation times `arm`, that going along for a while is
/// `motion`: a screw.
[[nodiscard]] Twist screw_of(const Motion& motion, const Eigen::Vector3d& centre, double arm);

/// How surfels were brought onto a view.
struct Alignment {
  Motion motion;
  double rms = 0;          ///< Of the distances along the normals of those that count, metres.
  double overlap = 0;      ///< Part of the surfels that count.
  std::size_t points = 0;  ///< That count.
  /// Unit twists that the shape does not show.
  std::vector<Twist> unobservable;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double arm = 0;
};

/// Brings `surfels` onto what `view` shows, beginning at `start`: each is compared with the place
/// of the view that it lies above or below (projective association along the untouched surface's
/// normal), by the distance along the view's normal and by the normals themselves; Gauss–Newton on
/// both with Tukey's weights. The spectrum of the normal equations says which directions are not
/// seen: nothing is moved along them but what makes the rotation least, so that a sliding ball
/// slides and does not roll.
[[nodiscard]] Alignment align(std::span<const Surfel> surfels, const ContactView& view,
                              const Motion& start);

}  // namespace dtact::perceive
