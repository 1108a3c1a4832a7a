#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "clients/perceive/pose/alignment.hpp"
#include "clients/perceive/pose/contact_patch.hpp"
#include "clients/perceive/pose/object_model.hpp"

namespace dtact::perceive {

/// Where a known object is.
struct Placement {
  Motion pose = Motion::Identity();  ///< The object's frame to the surface frame.
  double score = 0;                  ///< score_of(), at most 1.
  /// Covariance of the error of `pose`, as in Alignment: huge along the directions that neither the
  /// shape nor its outline determines, 0 along the others.
  Matrix6 covariance = Matrix6::Zero();
  /// Other placements that explain the contact as well and that no motion along those directions
  /// leads to.
  std::uint32_t alternatives = 0;
  bool kept = false;  ///< It is the pose so far, refined.
};

/// Searches all placements of the object: directions on a sphere in steps of 5° and the resting
/// positions on a plane, each rotated in steps of 10°, the lowest part on the contact's core. Hill
/// climbing refines the best. Returns nothing where none explains the contact, and soon after a
/// request of `stop`. The whole contact must be in view. Takes some tenths of a second.
/// `present`: the pose so far, which is kept if it explains the contact equally well.
[[nodiscard]] std::optional<Placement> search(const ObjectModel& object, const ContactPatch& patch,
                                              const std::optional<Motion>& present = {},
                                              const std::stop_token& stop = {});

}  // namespace dtact::perceive
