#include "tests/accuracy/atlas/rows.hpp"

#include <cmath>
#include <utility>

#include "tests/accuracy/atlas/scenes.hpp"

namespace dtact::atlas {
namespace {

using Spoil = std::function<void(Shot&, int, double)>;

constexpr int kFrames = kReady + 60;  // a second after the reference
constexpr int kPress = kReady + 6;    // the first frame that shows the object

/// Untouched until kPress, then pressed. From kReady on `spoil` changes each shot.
Script press(std::shared_ptr<const hal::sim::Truth> truth, double value, const Spoil& spoil) {
  Script script;
  script.truth = std::move(truth);
  script.frames = kFrames;
  script.shot = [value, spoil](int n) {
    Shot shot;
    if (n >= kPress) shot.moment = moment_of(0);
    if (n >= kReady && spoil) spoil(shot, n, value);
    return shot;
  };
  return script;
}

/// On the ball; with `rezero` the reference is taken anew under the condition, before the press.
std::function<Script(double)> on_ball(const Spoil& spoil, bool rezero = false) {
  return [spoil, rezero](double value) {
    Script script = press(ball_truth(), value, spoil);
    if (!rezero) return script;
    constexpr int kAgain = 40;  // frames for the new reference
    script.frames += kAgain;
    script.rezero = kReady + 6;
    script.shot = [value, spoil](int n) {
      Shot shot;
      if (n >= kPress + kAgain) shot.moment = moment_of(0);
      if (n >= kReady) spoil(shot, n, value);
      return shot;
    };
    return script;
  };
}

/// The object at the depth or size that is swept, under a clean image.
std::function<Script(double)> object(const std::function<Pose(double)>& pose) {
  return [pose](double value) { return press(solve({pose(value)}), value, {}); };
}

void dim(Shot& shot, int /*n*/, double factor) { shot.exposure = factor; }
void kill(Shot& shot, int /*n*/, double count) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) shot.light.leds[i] = {};
}

// NOLINTBEGIN(clang-analyzer-cplusplus.NewDeleteLeaks): the rows' functions are copied from a list
// of temporaries, whose destructors the analyser does not follow
std::vector<Row> light_rows() {
  return {
      {"light",
       "brightness_down",
       "LEDs dimmer than at the reference, nothing re-zeroed",
       "of the light",
       {1, 0.995, 0.99, 0.98, 0.96, 0.9, 0.75, 0.5},
       on_ball(dim),
       ""},
      {"light",
       "brightness_up",
       "LEDs brighter, nothing re-zeroed",
       "of the light",
       {1, 1.005, 1.01, 1.02, 1.04, 1.1, 1.25, 1.5},
       on_ball(dim),
       ""},
      {"light",
       "brightness_rezero",
       "LEDs dimmer or brighter, then re-zeroed",
       "of the light",
       {1, 1.25, 1.5, 0.75, 0.5, 0.25},
       on_ball(dim, true),
       ""},
      {"light",
       "dead_leds",
       "LEDs dead since the reference",
       "LEDs",
       {0, 1, 2, 3, 4},
       on_ball(kill),
       ""},
      {"light",
       "dead_leds_rezero",
       "LEDs dead, then re-zeroed",
       "LEDs",
       {0, 1, 2, 3, 4},
       on_ball(kill, true),
       ""},
      {"light",
       "colour",
       "LEDs turn warmer: blue lost, and half as much green",
       "share of blue lost",
       {0, 0.01, 0.02, 0.05, 0.1, 0.3},
       on_ball([](Shot& shot, int, double lost) {
         for (auto& led : shot.light.leds) {
           led.b = static_cast<std::uint8_t>(std::lround(255 * (1 - lost)));
           led.g = static_cast<std::uint8_t>(std::lround(255 * (1 - lost / 2)));
         }
       }),
       ""},
      {"light",
       "exposure_drift",
       "exposure or gain drifts by so much within a second",
       "share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2},
       on_ball([](Shot& shot, int n, double drift) {
         shot.exposure = 1 + drift * (n - kReady) / (kFrames - kReady);
       }),
       ""},
      {"light",
       "saturation",
       "overexposed, then re-zeroed",
       "of the light",
       {1, 1.2, 1.4, 1.5, 1.6, 1.8, 2.2},
       on_ball(dim, true),
       ""},
      {"light",
       "near_dark",
       "hardly any light, then re-zeroed",
       "of the light",
       {1, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02},
       on_ball(dim, true),
       ""},
      {"light",
       "banding",
       "PWM bands: a rolling shutter against 400 Hz",
       "amplitude, share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1},
       on_ball([](Shot& shot, int, double band) { shot.band = band; }),
       ""},
      {"light",
       "banding_fast",
       "PWM bands: against 2 kHz",
       "amplitude, share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1},
       on_ball([](Shot& shot, int, double band) {
         shot.band = band;
         shot.band_rows = 18;
       }),
       ""},
      {"light",
       "leak",
       "ambient light leaks in at one edge",
       "grey levels at the edge",
       {0, 1, 2, 5, 10, 20, 40},
       on_ball([](Shot& shot, int, double leak) { shot.leak = leak; }),
       ""},
  };
}

std::vector<Row> image_rows() {
  return {
      {"image",
       "noise",
       "noise of a pixel",
       "times the nominal",
       {1, 2, 3, 4, 6, 8},
       on_ball([](Shot& shot, int, double noise) { shot.noise = noise; }),
       ""},
      {"image",
       "jpeg",
       "JPEG quality",
       "quality",
       {95, 90, 80, 60, 40, 20},
       on_ball([](Shot& shot, int, double q) { shot.jpeg = static_cast<int>(q); }),
       ""},
      {"image",
       "shift",
       "camera shifted since calibration",
       "pixels right and down",
       {0, 0.5, 1, 2, 3, 5, 10},
       on_ball([](Shot& shot, int, double px) { shot.shift_px = px; }),
       "an untouched layer has no texture, and pressed it looks as if the object lay elsewhere"},
      {"image",
       "turn",
       "camera rotated since calibration",
       "degrees",
       {0, 0.5, 1, 2, 3, 5},
       on_ball([](Shot& shot, int, double turn) { shot.turn_deg = turn; }),
       "as for the shift"},
      {"image",
       "defocus",
       "defocus",
       "standard deviation, pixels",
       {0, 1, 2, 4, 8, 12},
       on_ball([](Shot& shot, int, double blur) { shot.blur_px = blur; }),
       "the layer blurs by itself, so a lens that blurs as much looks like a blunter object"},
      {"image",
       "dust",
       "specks of dust since the reference",
       "specks in the field",
       {0, 2, 5, 20, 50, 200},
       on_ball([](Shot& shot, int, double n) { shot.dust = static_cast<int>(n); }),
       ""},
      {"image",
       "dead_pixels",
       "dead pixels since the reference",
       "pixels",
       {0, 10, 100, 500, 2000, 10000},
       on_ball([](Shot& shot, int, double n) { shot.dead_pixels = static_cast<int>(n); }),
       ""},
      {"image",
       "frozen",
       "the camera repeats one picture while the object comes",
       "frames",
       {0, 2, 4, 8, 20},
       [](double frozen) {
         Script script = press(ball_truth(), frozen, {});
         const int from = kPress;
         script.frames = from + 24;
         script.judged = std::max(4, static_cast<int>(frozen));
         const int until = from + static_cast<int>(frozen);
         script.frames = frozen > 0 ? until : from + 24;
         script.shot = [=](int n) {
           Shot shot;
           if (n >= from) shot.moment = moment_of(0);
           if (n >= from && n < until) shot.stale_share = 1;
           return shot;
         };
         script.moment = [=](int n) { return n >= from ? moment_of(0) : 0; };
         script.judged = frozen > 0 ? static_cast<int>(frozen) : 12;
         return script;
       },
       ""},
      {"image",
       "torn",
       "a frame whose lower share is the one before, as the object comes",
       "share",
       {0, 0.1, 0.25, 0.5, 0.75},
       [](double share) {
         Script script = press(ball_truth(), share, {});
         script.frames = kPress + 1;
         script.judged = 1;
         script.shot = [share](int n) {
           Shot shot;
           if (n >= kPress) shot.moment = moment_of(0);
           if (n == kPress) shot.stale_share = share;
           return shot;
         };
         return script;
       },
       ""},
      {"image",
       "truncated",
       "payloads cut short",
       "share of the frames",
       {0, 0.1, 0.25, 0.5, 1},
       on_ball([](Shot& shot, int n, double share) {
         shot.damaged = std::fmod(n * share, 1.0) + share >= 1;
       }),
       ""},
  };
}

std::vector<Row> scene_rows() {
  return {
      {"scene",
       "deep",
       "pressed deeper than the list, and than the layer",
       "mm",
       {1.0, 1.2, 1.4, 1.5, 1.6, 1.7, 1.79},
       object([](double depth) { return Pose{hal::sim::ball(5), 2, -1, depth}; }),
       ""},
      {"scene",
       "full_field",
       "a flat disc until no border is free",
       "radius, mm",
       {3, 4, 6, 8, 10, 12, 14, 16},
       object([](double radius) { return Pose{hal::sim::disc(radius), 0, 0, 0.5}; }),
       "a press of the whole field darkens it as a dimmer light does"},
      {"scene",
       "texture",
       "grooves 0.4 mm deep under a plate",
       "pitch, mm",
       {4, 3, 2, 1.5, 1, 0.6},
       object([](double pitch) { return Pose{hal::sim::grating(pitch, 0.4, 6), 0, 0, 0.6}; }),
       "what the layer's scattering has blurred away is not in the image"},
      {"scene",
       "walls",
       "a cube's steep walls",
       "depth, mm",
       {0.2, 0.4, 0.6, 0.8, 1.0, 1.2},
       object([](double depth) { return Pose{hal::sim::cube(6), 1, 1, depth}; }),
       "sloping walls make the same image, as for the texture"},
      {"scene",
       "bulge",
       "a large bulge round a long object",
       "depth, mm",
       {0.2, 0.5, 0.8, 1.1, 1.4, 1.6},
       object([](double depth) { return Pose{hal::sim::cylinder(6, 12), 0, 0, depth}; }),
       ""},
  };
}
// NOLINTEND(clang-analyzer-cplusplus.NewDeleteLeaks)

constexpr int kSlowFps = 10;
const std::vector<double> kDrifts = {0, 0.5, 1, 2, 3, 5};

/// From kReady on the light falls by 1 % a minute to so many percent less; a ball presses for two
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
       "touched",
       "reference taken at start while touched",
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

}  // namespace

std::vector<Row> rows() {
  std::vector<Row> all;
  for (auto part : {light_rows(), image_rows(), scene_rows(), reference_rows()}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

std::vector<Script> clean_scripts() {
  const auto truth = solve({{hal::sim::ball(5), 2, -1, 1.0},
                            {hal::sim::m4_nut(), -4, 2, 0.9},
                            {hal::sim::cylinder(3, 10), 3, -3, 0.8},
                            {hal::sim::ball(4), -6, -6, 0.4},
                            {hal::sim::disc(4), 1, 1, 0.5},
                            {hal::sim::ball_array(1, 3, 4, 4), 0, 0, 0.6}});
  std::vector<Script> scripts;
  for (const int jpeg : {0, 90}) {
    Script script;
    script.truth = truth;
    script.frames = kReady + 12 * 40;
    script.judged = script.frames - kReady;
    script.shot = [jpeg](int n) {
      Shot shot;
      shot.jpeg = jpeg;
      const int turn = (n - kReady) / 40;
      if (n >= kReady && turn % 2 == 1) {
        shot.moment = moment_of(static_cast<std::size_t>(turn / 2) % 6);
      }
      return shot;
    };
    scripts.push_back(script);
  }
  return scripts;
}

}  // namespace dtact::atlas
