#include "tests/accuracy/whole/moving_objects.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace dtact::whole {
namespace {

constexpr double kPressSeconds = 1;
constexpr double kAboveMm = 0.1;
constexpr std::uint64_t kRestFrames = 6;
constexpr std::uint64_t kAwayFrames = 30;
// Off centre, so that a slide ends equally far on the other side.
constexpr double kStartXMm = -1.4;
constexpr double kStartYMm = -0.6;
constexpr double kSlideDeg = 26;
constexpr double kRollAxisDeg = 114;

using hal::sim::PressKey;

double radians(double degrees) { return degrees * M_PI / 180; }

PressKey shifted(double mm) {
  return {.x_mm = mm * std::cos(radians(kSlideDeg)), .y_mm = mm * std::sin(radians(kSlideDeg))};
}

PressKey rolled(PressKey key, double degrees) {
  key.tilt_x_deg = degrees * std::cos(radians(kRollAxisDeg));
  key.tilt_y_deg = degrees * std::sin(radians(kRollAxisDeg));
  return key;
}

PressKey all_at_once(double part) {
  PressKey key = rolled(shifted(4 * part), 15 * part);
  key.rotation_deg = 60 * part;
  key.depth_mm = 0.3 * part;
  return key;
}

PressKey around(double part) {
  const double phase = 5 * part * 2 * M_PI;
  PressKey key = rolled(shifted(1.5 * std::sin(phase)), 4 * std::sin(2 * phase));
  key.y_mm += 0.8 * std::sin(2 * phase);
  key.rotation_deg = 20 * std::sin(phase);
  key.depth_mm = 0.1 * std::sin(3 * phase);
  return key;
}

/// Distance that it has moved and by which it has dragged the gel, millimetres, at a part of the
/// time.
struct Stroke {
  double part, mm, drag_mm;
};
constexpr std::array kStrokes{
    Stroke{0, 0, 0},         Stroke{0.15, 0.3, 0.3},  Stroke{0.18, 0.4, 0.1}, Stroke{0.5, 1.6, 0.1},
    Stroke{0.65, 1.2, -0.3}, Stroke{0.68, 1.1, -0.1}, Stroke{1, 0.1, -0.1}};

PressKey stick_and_slip(double part) {
  const auto* const to =
      std::ranges::find_if(kStrokes.begin() + 1, kStrokes.end() - 1,
                           [part](const Stroke& one) { return part <= one.part; });
  const Stroke& from = *(to - 1);
  const double along = (part - from.part) / (to->part - from.part);
  PressKey key = shifted(std::lerp(from.mm, to->mm, along));
  const PressKey drag = shifted(std::lerp(from.drag_mm, to->drag_mm, along));
  key.drag_x_mm = drag.x_mm;
  key.drag_y_mm = drag.y_mm;
  return key;
}

constexpr std::array kCommonMotions{
    ObjectMotion{"turn", 3, [](double part) { return PressKey{.rotation_deg = 60 * part}; }},
    ObjectMotion{"slide", 2, [](double part) { return shifted(4 * part); }},
    ObjectMotion{"roll", 2, [](double part) { return rolled({}, 15 * part); }},
    ObjectMotion{"deeper", 1, [](double part) { return PressKey{.depth_mm = 0.3 * part}; }},
    ObjectMotion{"all", 4, all_at_once},
};
constexpr std::array kLongMotions{ObjectMotion{"minute", 60, around},
                                  ObjectMotion{"drag", 6, stick_and_slip}};

}  // namespace

std::span<const ObjectMotion> common_motions() { return kCommonMotions; }
std::span<const ObjectMotion> long_motions() { return kLongMotions; }

std::vector<MotionFrames> choreograph(const MovingObject& object,
                                      std::span<const ObjectMotion> motions,
                                      hal::sim::Scene& scene) {
  const double fps = scene.camera.fps;
  const auto frames_of = [fps](double seconds) {
    return static_cast<std::uint64_t>(std::lround(seconds * fps));
  };
  scene.gel.solve_step_mm = 5;  // the scene has a key in every frame instead
  auto& keys = scene.presses.at(0).keys;
  keys.clear();
  const auto add = [&](std::uint64_t frame, const PressKey& moved, double depth_mm) {
    PressKey key = moved;
    key.time_s = static_cast<double>(frame) / fps;
    key.x_mm += kStartXMm;
    key.y_mm += kStartYMm;
    key.rotation_deg += object.start_deg;
    key.depth_mm = depth_mm;
    keys.push_back(key);
  };
  std::vector<MotionFrames> all;
  std::uint64_t first = kReferenceFrames;
  for (const ObjectMotion& motion : motions) {
    MotionFrames frames;
    frames.first = first;
    const std::uint64_t pressed = first + frames_of(kPressSeconds);
    frames.motion = pressed + kRestFrames;
    frames.end = frames.motion + frames_of(motion.seconds);
    frames.last = frames.end + kRestFrames;
    for (std::uint64_t n = first; n <= pressed; ++n) {
      const double part = static_cast<double>(n - first) / static_cast<double>(pressed - first);
      add(n, motion.moved(0), std::lerp(-kAboveMm, object.depth_mm, part));
    }
    for (std::uint64_t n = frames.motion; n <= frames.end; ++n) {
      const double part =
          static_cast<double>(n - frames.motion) / static_cast<double>(frames.end - frames.motion);
      const PressKey moved = motion.moved(part);
      add(n, moved, object.depth_mm + moved.depth_mm);
    }
    const PressKey moved = motion.moved(1);
    add(frames.last, moved, object.depth_mm + moved.depth_mm);
    add(frames.last + 1, moved, -1);
    first = frames.last + kAwayFrames;
    all.push_back(frames);
  }
  return all;
}

}  // namespace dtact::whole
