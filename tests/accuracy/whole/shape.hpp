#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "hal/sim/scene.hpp"
#include "tests/accuracy/whole/pose_track.hpp"

namespace dtact::whole {

/// A direction of motion, and how much of it the layer shows.
struct ShownDirection {
  Direction direction;
  double shown =
      0;  ///< Millimetres of depth, root mean square over the contact, for one of motion.
};

/// Six directions, the least shown first: the principal axes of how the true indentation changes
/// when the object of the scene's first press is moved, from where it is at frame `sequence`, by
/// 0.2 mm (rotations: at the contact's edge) and the layer is solved again. Of a flat layer.
[[nodiscard]] std::array<ShownDirection, 6> shown_directions(const hal::sim::Scene& scene,
                                                             std::uint64_t sequence);

}  // namespace dtact::whole
