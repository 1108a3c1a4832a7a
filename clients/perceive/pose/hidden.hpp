#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "clients/perceive/pose/alignment.hpp"

namespace dtact::perceive {

/// Directions along which nobody knows how far a thing has moved: unit twists that go along with
/// it.
class Hidden {
 public:
  Hidden() = default;
  /// `twists` about `centre`, their rotation times `arm`, in the thing's own frame.
  Hidden(std::vector<Twist> twists, const Eigen::Vector3d& centre, double arm)
      : twists_(std::move(twists)), centre_(centre), arm_(arm) {}

  /// Those of `twists`, as `at` has its own, that are not among these yet. True where that is any.
  bool add(const std::vector<Twist>& twists, const Alignment& at);
  /// The same as twists of `at`.
  [[nodiscard]] std::vector<Twist> seen_at(const Alignment& at) const;

 private:
  std::vector<Twist> twists_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double arm_ = 0;
};

/// Twists of `from` as twists of `to`, both in the surface frame.
[[nodiscard]] std::vector<Twist> seen_from(const std::vector<Twist>& twists, const Alignment& from,
                                           const Alignment& to);

/// What both have in common. `a` is orthonormal.
[[nodiscard]] std::vector<Twist> in_both(const std::vector<Twist>& a, const std::vector<Twist>& b);

}  // namespace dtact::perceive
