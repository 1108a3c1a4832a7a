#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "hal/sim/objects.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::atlas {

/// An object at rest in the gel.
struct Pose {
  hal::sim::Object object;
  double x_mm = 0;
  double y_mm = 0;
  double depth_mm = 0;
};

/// Solves each pose by itself; moment_of(i) is a frame at which only poses[i] presses, and frame 0
/// shows the undeformed gel.
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> solve(const std::vector<Pose>& poses);
[[nodiscard]] std::uint64_t moment_of(std::size_t pose);

/// The ball of most rows: 5 mm, 1 mm deep, off the centre. Solved once.
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> ball_truth();

}  // namespace dtact::atlas
