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
  /// Of the error of `pose`, as Alignment has it: huge along the directions that neither the shape
  /// nor its outline determines, 0 along the others.
  Matrix6 covariance = Matrix6::Zero();
  /// Other placements that explain the contact as well and that no motion along those directions
  /// leads to.
  std::uint32_t alternatives = 0;
};

/// Looks for the object everywhere: its underside in every direction (all over a sphere, 5° apart,
/// and where it rests on a plane), turned in steps of 10°, its lowest part laid on the contact's
/// core; the best are climbed from. Nothing where none explains the contact. The whole contact has
/// to be in view. Takes some tenths of a second; ends soon after `stop` is asked for, with nothing.
/// `present`: where the object is held to be, which stays if it explains the contact as well.
[[nodiscard]] std::optional<Placement> search(const ObjectModel& object, const ContactPatch& patch,
                                              const std::optional<Motion>& present = {},
                                              const std::stop_token& stop = {});

}  // namespace dtact::perceive
