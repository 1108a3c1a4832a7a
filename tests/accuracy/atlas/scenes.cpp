#include "tests/accuracy/atlas/scenes.hpp"

#include <cmath>

namespace dtact::atlas {
namespace {

double begin_s(std::size_t pose) { return 1 + 2 * static_cast<double>(pose); }

}  // namespace

std::shared_ptr<const hal::sim::Truth> solve(const std::vector<Pose>& poses) {
  hal::sim::Scene scene = hal::sim::default_scene();
  scene.gel.solve_step_mm = 5;  // only objects at rest are judged
  scene.loop_from_s = scene.loop_to_s = 0;
  scene.presses.clear();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose& pose = poses[i];
    const double t = begin_s(i);
    const auto key = [&](double after, double depth) {
      return hal::sim::PressKey{t + after, pose.x_mm, pose.y_mm, depth, 0};
    };
    scene.presses.push_back(
        {pose.object, {key(0, 0), key(0.1, pose.depth_mm), key(0.9, pose.depth_mm), key(1, 0)}});
  }
  return std::make_shared<const hal::sim::Truth>(scene);
}

std::uint64_t moment_of(std::size_t pose) {
  return static_cast<std::uint64_t>(std::lround((begin_s(pose) + 0.5) * 60));
}

std::shared_ptr<const hal::sim::Truth> ball_truth() {
  static const auto truth = solve({{hal::sim::ball(5), 2, -1, 1.0}});
  return truth;
}

}  // namespace dtact::atlas
