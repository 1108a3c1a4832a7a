#include <algorithm>

#include "tests/accuracy/atlas/rows.hpp"
#include "tests/accuracy/atlas/scripts.hpp"

namespace dtact::atlas {
namespace {

constexpr int kSlowFps = 10;
const std::vector<double> kDrifts = {0, 0.5, 1, 2, 3, 5};

/// From kReady on the light falls by 1 % a minute to a total of `percent`; a ball presses for two
/// of every six seconds, and at the end.
Script drifting(double percent, bool follow) {
  Script script;
  script.truth = ball_truth();
  script.fps = kSlowFps;
  script.follow = follow;
  const int minute = 60 * kSlowFps;
  const int frames = kReady + std::max(minute / 2, static_cast<int>(percent * minute));
  script.frames = frames;
  script.shot = [=](int n) {
    Shot shot;
    const double passed = std::max(0, n - kReady) / static_cast<double>(frames - kReady);
    shot.exposure = 1 - 0.01 * percent * passed;
    if (n >= kPress && (frames - n) % (6 * kSlowFps) <= 2 * kSlowFps) shot.moment = moment_of(0);
    return shot;
  };
  return script;
}

}  // namespace

std::vector<Row> reference_rows() {
  return {
      {"reference",
       "relaxation",
       "re-zero asked for over the dent of a long press, which recovers later",
       "dent, mm",
       {0, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3},
       [](double dent) {
         Script script;
         script.truth = solve(
             {{hal::sim::ball(5), 2, -1, 1.0}, {hal::sim::ball(5), 2, -1, std::max(dent, 1e-4)}});
         script.frames = kFrames + 40;
         script.rezero = kReady + 6;
         script.force = false;
         script.shot = [](int n) {
           Shot shot;
           if (n >= kReady && n < kReady + 46) shot.moment = moment_of(1);
           if (n >= kReady + 50) shot.moment = moment_of(0);
           return shot;
         };
         return script;
       },
       ""},
      {"reference",
       "contact_at_start",
       "reference taken at start in contact",
       "depth, mm",
       {0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0},
       [](double depth) {
         Script script;
         script.truth = solve(
             {{hal::sim::ball(5), 2, -1, 1.0}, {hal::sim::ball(4), -4, 3, std::max(depth, 1e-4)}});
         script.frames = kFrames;
         script.shot = [](int n) {
           Shot shot;
           shot.moment = n < kPress ? moment_of(1) : moment_of(0);
           return shot;
         };
         return script;
       },
       ""},
      {"reference", "drift", "LEDs dim by 1 % a minute while a ball comes and goes, followed",
       "% in all", kDrifts, [](double percent) { return drifting(percent, true); }, ""},
      {"reference", "drift_kept", "the same, with the reference kept as it was taken", "% in all",
       kDrifts, [](double percent) { return drifting(percent, false); }, ""},
      {"reference",
       "flat",
       "a faint press of the whole field that lasts for half a minute",
       "depth, mm",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1},
       [](double depth) {
         Script script;
         script.truth = solve({{hal::sim::disc(16), 0, 0, std::max(depth, 1e-4)}});
         script.fps = kSlowFps;
         script.frames = kReady + 30 * kSlowFps;
         script.shot = [](int n) {
           Shot shot;
           if (n >= kPress) shot.moment = moment_of(0);
           return shot;
         };
         return script;
       },
       "a press of the whole field darkens it as a dimmer light does"},
      {"reference",
       "faint",
       "a faint press that lasts for half a minute, drift followed",
       "depth, mm",
       {0, 0.02, 0.05, 0.1, 0.2},
       [](double depth) {
         Script script;
         script.truth = solve({{hal::sim::ball(5), 2, -1, std::max(depth, 1e-4)}});
         script.frames = kReady + 1800;
         script.shot = [](int n) {
           Shot shot;
           if (n >= kPress) shot.moment = moment_of(0);
           return shot;
         };
         return script;
       },
       ""},
  };
}

}  // namespace dtact::atlas
