#pragma once

#include <string>
#include <vector>

#include "clients/perceive/pose/alignment.hpp"
#include "clients/perceive/pose/object_model.hpp"
#include "hal/sim/objects.hpp"
#include "tests/accuracy/pose/sequence.hpp"

namespace dtact::pose {

/// A simulated object as a file would tell it, as a cloud of points with normals in millimetres:
/// its underside, its upper side where it has one, and walls of 1.5 mm up where it ends or steps.
[[nodiscard]] perceive::Mesh cloud_of(const hal::sim::Object& object);

/// The turns about the object's z, in steps of 10, 15 and 72°, and about its x by half a turn with
/// them, after which its surface lies where it did, within 1.2 times the surfels' distance (the
/// rows that a cloud ends with need not be alike): the first is none.
[[nodiscard]] std::vector<perceive::Motion> symmetries_of(const perceive::ObjectModel& object);

/// How a known object is found and followed while it moves.
struct KnownResult {
  int frames = 0;
  int unplaced = 0;  ///< SEARCHING or LOST: search() found nothing, or the object was lost.
  int others = 0;    ///< Placed further than 0.5 mm or 10° from the truth.
  std::uint32_t alternatives = 0;  ///< Of the first placement.
  std::size_t hidden = 0;
  /// Of the first placement and of all frames, but for what is hidden and for the object's
  /// symmetries: the contact's centre, micrometres, and degrees.
  double first_um = 0;
  double first_deg = 0;
  std::vector<double> um;
  std::vector<double> degrees;
  double search_ms = 0;  ///< Of the first one, the processor's time, on a thread of its own.
  std::vector<double> frame_us;
};

/// Follows `object`, whose file cloud_of() would be, along `way` in so many steps. Searches are
/// waited for.
[[nodiscard]] KnownResult follow_known(const std::string& object, const Way& way, int steps,
                                       const recon::Surface& surface = {});

}  // namespace dtact::pose
