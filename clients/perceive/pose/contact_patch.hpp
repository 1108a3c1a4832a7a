#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "clients/perceive/pose/contact_view.hpp"
#include "clients/perceive/pose/motion.hpp"

namespace dtact::perceive {

/// A few hundred samples of the gel's surface in one frame: where the gel lies against the object,
/// and where the object can only be further away. All samples are in the contact's frame: its
/// origin is the middle of the contact, z the undeformed surface's normal there, towards the
/// object. Metres. It references no other data, so another thread may own it.
struct ContactPatch {
  struct Sample {
    Eigen::Vector3d point;
    Eigen::Vector3d normal;
  };
  /// Samples where the gel lies against the object. Between an object's edge and the undeformed
  /// surface the gel forms a shoulder; under an object it is flat or a bowl.
  std::vector<Sample> core;
  /// Some of all other places: no part of the object is below them.
  std::vector<Sample> beside;
  /// How many places of the core one of them stands for.
  double beside_weight = 1;
  /// The contact's frame to the surface frame.
  Motion frame = Motion::Identity();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< The core's middle.
  double lowest = 0;   ///< z of the core, but for its lowest twentieth.
  double highest = 0;  ///< And but for its highest.
  double arm = 0;      ///< How far the core reaches from its middle: root mean square.
  double area = 0;     ///< The core's area, square metres.
};

/// At most about 1500 samples of the core and twice as many beside, each in no order. No core where
/// nothing is seen.
[[nodiscard]] ContactPatch make_patch(const ContactView& view);

/// At most `most` of the core's samples and twice as many of the others.
[[nodiscard]] ContactPatch thinned(const ContactPatch& patch, std::size_t most);

}  // namespace dtact::perceive
