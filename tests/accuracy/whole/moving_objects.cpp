#include "tests/accuracy/whole/moving_objects.hpp"

#include <cmath>

namespace dtact::whole {
namespace {

constexpr double kPressSeconds = 1;
constexpr double kAboveMm = 0.1;
constexpr std::uint64_t kRestFrames = 6;
constexpr std::uint64_t kAwayFrames = 30;
// Off centre, and such that a slide ends as far from it on the other side.
constexpr double kStartXMm = -1.4;
constexpr double kStartYMm = -0.6;
constexpr double kSlideDeg = 26;
constexpr double kRollAxisDeg = 114;

}  // namespace

std::vector<MotionFrames> choreograph(const MovingObject& object,
                                      std::span<const ObjectMotion> motions,
                                      hal::sim::Scene& scene) {
  const double fps = scene.camera.fps;
  const auto frames_of = [fps](double seconds) {
    return static_cast<std::uint64_t>(std::lround(seconds * fps));
  };
  const auto radians = [](double degrees) { return degrees * M_PI / 180; };
  scene.layer.solve_step_mm = 5;  // a key in every frame does instead
  auto& keys = scene.presses.at(0).keys;
  keys.clear();
  const auto add = [&](std::uint64_t frame, const ObjectMotion& motion, double part,
                       double depth_mm) {
    keys.push_back({.time_s = static_cast<double>(frame) / fps,
                    .x_mm = kStartXMm + part * motion.slide_mm * std::cos(radians(kSlideDeg)),
                    .y_mm = kStartYMm + part * motion.slide_mm * std::sin(radians(kSlideDeg)),
                    .depth_mm = depth_mm,
                    .rotation_deg = object.start_deg + part * motion.turn_deg,
                    .tilt_x_deg = part * motion.roll_deg * std::cos(radians(kRollAxisDeg)),
                    .tilt_y_deg = part * motion.roll_deg * std::sin(radians(kRollAxisDeg))});
  };
  std::vector<MotionFrames> all;
  std::uint64_t first = kUntouchedFrames;
  for (const ObjectMotion& motion : motions) {
    MotionFrames frames;
    frames.first = first;
    const std::uint64_t pressed = first + frames_of(kPressSeconds);
    frames.motion = pressed + kRestFrames;
    frames.end = frames.motion + frames_of(motion.seconds);
    frames.last = frames.end + kRestFrames;
    for (std::uint64_t n = first; n <= pressed; ++n) {
      const double part = static_cast<double>(n - first) / static_cast<double>(pressed - first);
      add(n, motion, 0, std::lerp(-kAboveMm, object.depth_mm, part));
    }
    for (std::uint64_t n = frames.motion; n <= frames.end; ++n) {
      const double part =
          static_cast<double>(n - frames.motion) / static_cast<double>(frames.end - frames.motion);
      add(n, motion, part, object.depth_mm + part * motion.deeper_mm);
    }
    add(frames.last, motion, 1, object.depth_mm + motion.deeper_mm);
    add(frames.last + 1, motion, 1, -1);
    first = frames.last + kAwayFrames;
    all.push_back(frames);
  }
  return all;
}

}  // namespace dtact::whole
