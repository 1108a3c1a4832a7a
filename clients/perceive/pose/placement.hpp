#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "clients/perceive/pose/contact_patch.hpp"
#include "clients/perceive/pose/object_model.hpp"

namespace dtact::perceive {

/// The underside of an object that is turned in some way, on a square grid: in each cell its lowest
/// surfel. The frame of the underside has z up and its lowest point at z = 0.
class BottomView {
 public:
  /// `turn`: the object's frame to the underside's, but for the height. What is higher than
  /// `highest` above the lowest point is left out.
  BottomView(const ObjectModel& object, const Eigen::Matrix3d& turn, double highest);

  /// The object's frame to the underside's.
  [[nodiscard]] const Motion& from_object() const noexcept { return from_object_; }
  /// The surfel that `point` lies below or above; null beside the object.
  [[nodiscard]] const Surfel* at(const Eigen::Vector3d& point) const noexcept {
    const double column = (point.x() - x0_) * per_cell_;
    const double row = (point.y() - y0_) * per_cell_;
    if (!(column >= 0 && row >= 0 && column < width_ && row < height_)) return nullptr;
    const std::int32_t found =
        cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(column)];
    return found < 0 ? nullptr : &surfels_[static_cast<std::size_t>(found)];
  }
  /// The middle (x and y) and area of what is lower than `height`.
  struct Low {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    double area = 0;
  };
  [[nodiscard]] Low below(double height) const;

 private:
  void fill_holes();

  Motion from_object_ = Motion::Identity();
  std::vector<Surfel> surfels_;
  std::vector<std::int32_t> cells_;  ///< Indices into surfels_; −1: none.
  double x0_ = 0;
  double y0_ = 0;
  double per_cell_ = 0;
  int width_ = 0;
  int height_ = 0;
};

/// How well an object with this underside explains a contact. The score is the part of the core
/// that lies on it, weighted by distance (1 on it, 0 from `limit` on), minus the places where the
/// object would be inside the gel. At most 1. `move`: the contact's frame to the underside's.
[[nodiscard]] double score_of(const BottomView& bottom, const ContactPatch& patch,
                              const Motion& move, double limit);

/// `move` after a twist about the patch's middle, its rotation times the patch's arm.
[[nodiscard]] Motion twisted(const Motion& move, const ContactPatch& patch, const Twist& twist);

/// Climbs to a better score: each of the six directions in turn, with steps that are halved from
/// `step` on as long as they are longer than `last`, metres.
struct ScoredPose {
  Motion move = Motion::Identity();
  double score = 0;
};
[[nodiscard]] ScoredPose hill_climb(const BottomView& bottom, const ContactPatch& patch,
                                    const Motion& move, double step, double last);

/// Unit twists about the patch's middle, in the contact's frame, along which the score hardly
/// changes over a quarter of a millimetre: neither the contact's shape nor its outline shows them.
[[nodiscard]] std::vector<Twist> unobservable_twists(const BottomView& bottom,
                                                     const ContactPatch& patch, const Motion& move);

}  // namespace dtact::perceive
