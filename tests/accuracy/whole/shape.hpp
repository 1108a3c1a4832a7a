#pragma once

#include <array>
#include <cstdint>

#include "hal/sim/placement.hpp"
#include "hal/sim/scene.hpp"
#include "tests/accuracy/whole/pose_error.hpp"

namespace dtact::whole {

/// From the object's frame to the simulator's surface frame, millimetres.
[[nodiscard]] Eigen::Isometry3d isometry_of(const hal::sim::Pose& pose);

/// A direction of motion, and how much of it the gel shows.
struct ShownDirection {
  Direction direction;
  double shown = 0;  ///< RMS change of depth over the contact, mm for a mm of motion.
};

/// Six directions, the least shown first: the principal axes of the change of the true indentation
/// when the object of the scene's first press is moved, from its pose at frame `sequence`, by
/// 0.2 mm (rotations: at the contact's edge) and the gel is solved again. A curved surface is
/// replaced by its tangent plane.
[[nodiscard]] std::array<ShownDirection, 6> shown_directions(const hal::sim::Scene& scene,
                                                             std::uint64_t sequence);

}  // namespace dtact::whole
