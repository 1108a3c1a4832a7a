#include "tests/accuracy/whole/random_draw.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <utility>

#include "hal/sim/objects.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::whole {
namespace {

namespace sim = hal::sim;

constexpr double kShallowestMm = 0.05;
constexpr double kMaxShare = 0.8;
constexpr double kBeginS = 0.8;  // the reference is taken by then
constexpr double kAboveMm = 0.1;

struct NamedObject {
  sim::Object object;
  std::string name;
};

NamedObject draw_object(Draw& draw) {
  constexpr int kKinds = 16;
  switch (draw.index(kKinds)) {
    case 0: {
      const double radius = draw.uniform(1.5, 8);
      return {sim::ball(radius), fmt::format("ball r {:.1f}", radius)};
    }
    case 1: {
      const double radius = draw.uniform(0.8, 2);
      const double pitch = draw.uniform(2.2, 3.5) * radius;
      const int rows = draw.between(1, 3);
      const int columns = draw.between(2, 3);
      return {sim::ball_array(radius, pitch, rows, columns),
              fmt::format("{}x{} balls r {:.1f}", rows, columns, radius)};
    }
    case 2: {
      const double radius = draw.uniform(1, 5);
      return {sim::disc(radius), fmt::format("disc r {:.1f}", radius)};
    }
    case 3: {
      const double radius = draw.uniform(0.8, 2.5);
      const double gap = draw.uniform(0.5, 4);
      return {sim::two_pillars(radius, 2 * radius + gap),
              fmt::format("two pillars r {:.1f} gap {:.1f}", radius, gap)};
    }
    case 4: {
      const double side = draw.uniform(2, 8);
      return {sim::cube(side), fmt::format("cube {:.1f}", side)};
    }
    case 5: {
      const double radius = draw.uniform(1, 5);
      const double length = draw.uniform(3, 12);
      return {sim::cylinder(radius, length),
              fmt::format("cylinder r {:.1f} l {:.1f}", radius, length)};
    }
    case 6: {
      const double pitch = draw.uniform(1, 4);
      const double groove = draw.uniform(0.3, 1.2);
      const double side = draw.uniform(4, 10);
      return {sim::grating(pitch, groove, side),
              fmt::format("grating pitch {:.1f} groove {:.1f} side {:.1f}", pitch, groove, side)};
    }
    case 7: {
      const double radius = draw.uniform(2, 5);
      return {sim::star(radius), fmt::format("star r {:.1f}", radius)};
    }
    case 8:
      return {sim::pin_board(), "pin board"};
    case 9:
      return {sim::m4_nut(), "M4 nut"};
    case 10:
      return {sim::m3_long_nut(), "long M3 nut"};
    case 11:
      return {sim::m5_hexagon_screw(), "M5 screw"};
    case 12:
      return {sim::three_set_screws(), "set screws"};
    case 13:
      return {sim::screw_cap(), "screw cap"};
    case 14:
      return {sim::usb_c_plug(), "USB-C plug"};
    default:
      return {sim::key(), "key"};
  }
}

/// Writes the keys of one object's press, second by second.
class PressWriter {
 public:
  PressWriter(Draw& draw, double begin_s, double thickness_mm)
      : draw_(draw), time_s_(begin_s), named_(draw_object(draw)) {
    const double reach = draw_.chance(0.3) ? 11 : 7;  // the map ends at 12
    at_ = {.time_s = begin_s,
           .x_mm = draw_.uniform(-reach, reach),
           .y_mm = draw_.uniform(-reach, reach),
           .depth_mm = -kAboveMm,
           .rotation_deg = draw_.uniform(0, 360)};
    if (draw_.chance(0.7)) {
      const double tilt = draw_.uniform(0, draw_.chance(0.2) ? 25 : 8);
      const double axis = draw_.uniform(0, 2 * std::numbers::pi);
      at_.tilt_x_deg = tilt * std::cos(axis);
      at_.tilt_y_deg = tilt * std::sin(axis);
    }
    const double most = kMaxShare * thickness_mm;
    depth_mm_ =
        draw_.chance(0.5) ? draw_.uniform(0.1, most) : draw_.log_uniform(kShallowestMm, most);
    speed_ = draw_.log_uniform(1, 20);
    press_.object = named_.object;
    add();
  }

  double press() { return move_to(depth_mm_); }
  double lift() { return move_to(-kAboveMm); }
  double hold(double seconds) {
    time_s_ += seconds;
    add();
    return time_s_;
  }
  double slide() {
    const double length = draw_.uniform(1, 4);
    const double heading = draw_.uniform(0, 2 * std::numbers::pi);
    at_.x_mm += length * std::cos(heading);
    at_.y_mm += length * std::sin(heading);
    at_.rotation_deg += draw_.uniform(-30, 30);
    return hold(length / draw_.log_uniform(2, 10));
  }

  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] const sim::Press& press_keys() const noexcept { return press_; }
  [[nodiscard]] std::string words() const {
    return fmt::format("{}, {:.2f} deep, at {:.1f}, {:.1f}, tilted {:.0f}", named_.name, depth_mm_,
                       press_.keys.front().x_mm, press_.keys.front().y_mm,
                       std::hypot(at_.tilt_x_deg, at_.tilt_y_deg));
  }

 private:
  void add() {
    at_.time_s = time_s_;
    press_.keys.push_back(at_);
  }
  double move_to(double depth_mm) {
    time_s_ += std::abs(depth_mm - at_.depth_mm) / speed_;
    at_.depth_mm = depth_mm;
    add();
    return time_s_;
  }

  Draw& draw_;
  double time_s_;
  NamedObject named_;
  double depth_mm_ = 0;
  double speed_ = 0;
  sim::PressKey at_;
  sim::Press press_;
};

class SceneWriter {
 public:
  SceneWriter(RandomScene& out, Draw& draw) : out_(out), draw_(draw) {
    judge(kBeginS - 0.08, Phase::before);
  }

  void judge(double time_s, Phase phase) {
    const auto sequence = static_cast<std::uint64_t>(std::lround(time_s * out_.scene.camera.fps));
    if (!out_.judged.empty() && out_.judged.back().sequence >= sequence) return;
    out_.judged.push_back({sequence, phase});
  }
  void judge_between(double from_s, double to_s, Phase phase) {
    for (const double part : {0.4, 0.8}) judge(std::lerp(from_s, to_s, part), phase);
  }
  void judge_after(double lifted_s) {
    for (const double seconds : {0.1, 0.25}) judge(lifted_s + seconds, Phase::after);
  }

  /// Presses in and holds. Returns the time at its end.
  double press(PressWriter& writer) {
    const double from = writer.time_s();
    const double pressed = writer.press();
    judge_between(from, pressed, Phase::moving);
    const double held = writer.hold(draw_.uniform(0.3, 0.5));
    judge(pressed + 0.15, Phase::rest);
    judge(held - 0.05, Phase::rest);
    return held;
  }

  void add(const PressWriter& writer) {
    out_.scene.presses.push_back(writer.press_keys());
    out_.what += (out_.what.empty() ? "" : "; ") + writer.words();
  }

 private:
  RandomScene& out_;
  Draw& draw_;
};

void draw_presses(RandomScene& out, Draw& draw) {
  const double thickness = out.scene.gel.thickness_mm;
  SceneWriter scene(out, draw);
  const double kind = draw.uniform(0, 1);
  if (kind < 0.05) {
    out.what = "no contact";
    for (const double seconds : {1.5, 2.5}) scene.judge(seconds, Phase::after);
    return;
  }
  PressWriter first(draw, kBeginS, thickness);
  double end = scene.press(first);
  if (kind < 0.55) {
    scene.judge_after(first.lift());
    scene.add(first);
    return;
  }
  if (kind < 0.7) {
    const double from = end;
    end = first.slide();
    scene.judge_between(from, end, Phase::slide);
    end = first.hold(0.25);
    scene.judge(end - 0.05, Phase::rest);
    scene.judge_after(first.lift());
    scene.add(first);
    out.what += ", slides";
    return;
  }
  if (kind < 0.85) {  // a second object beside the first
    PressWriter second(draw, end, thickness);
    end = scene.press(second);
    (void)first.hold(end - first.time_s());
    (void)first.lift();
    (void)second.lift();
    scene.judge_after(std::max(first.time_s(), second.time_s()));
    scene.add(first);
    scene.add(second);
    out.what += " (both)";
    return;
  }
  const double lifted = first.lift();
  scene.judge_after(lifted);
  PressWriter second(draw, lifted + 0.3, thickness);
  (void)scene.press(second);
  scene.judge_after(second.lift());
  scene.add(first);
  scene.add(second);
}

void draw_light(RandomScene& out, Draw& draw) {
  const sim::LedLevels full = sim::led_levels({});
  const double kind = draw.uniform(0, 1);
  const auto one_led = [&] {
    sim::LedLevels leds = full;
    auto& led = leds.at(static_cast<std::size_t>(draw.index(hal::kLedCount)));
    led = draw.chance(0.5) ? std::uint16_t{0}
                           : static_cast<std::uint16_t>(draw.uniform(0.3, 0.9) * led);
    return leds;
  };
  if (kind < 0.6) return;
  if (kind < 0.7) {
    out.light = LightCase::brighter;
    const double gain = draw.uniform(0.6, 1.25);
    out.what += fmt::format("; light {:.2f} times as bright", gain);
    out.lighting = [=](std::uint64_t) { return Lighting{full, gain}; };
  } else if (kind < 0.8) {
    out.light = LightCase::led;
    const sim::LedLevels leds = one_led();
    out.what += "; one LED dimmer or dead";
    out.lighting = [=](std::uint64_t) { return Lighting{leds, 1}; };
  } else if (kind < 0.92) {
    out.light = LightCase::drift;
    const double per_minute = draw.uniform(-0.02, 0.02);
    const double fps = out.scene.camera.fps;
    out.what += fmt::format("; light drifts {:+.1f} %/min", 100 * per_minute);
    out.lighting = [=](std::uint64_t sequence) {
      return Lighting{full, 1 + per_minute * static_cast<double>(sequence) / fps / 60};
    };
  } else {
    out.light = LightCase::led_fails;
    const sim::LedLevels leds = one_led();
    const auto from = static_cast<std::uint64_t>(draw.uniform(
        kBeginS * out.scene.camera.fps, static_cast<double>(out.judged.back().sequence)));
    out.what += fmt::format("; an LED dims or dies in frame {}", from);
    out.lighting = [=](std::uint64_t sequence) {
      return Lighting{sequence < from ? full : leds, 1};
    };
  }
}

/// Nothing where a contact has no solution or more than kMaxNewtons press.
std::shared_ptr<const sim::Truth> solve_if_light(const sim::Scene& scene) {
  try {
    auto truth = std::make_shared<const sim::Truth>(scene);
    for (const sim::Press& press : scene.presses) {
      for (const sim::PressKey& key : press.keys) {
        const double sequence = std::round(key.time_s * scene.camera.fps);
        if (truth->force_n(static_cast<std::uint64_t>(sequence)) > kMaxNewtons) return nullptr;
      }
    }
    return truth;
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

}  // namespace

std::uint64_t seed_of(std::uint64_t seed, int number) {
  std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U),
                         static_cast<std::uint32_t>(number)};
  std::array<std::uint32_t, 2> words{};
  sequence.generate(words.begin(), words.end());
  return std::uint64_t{words[0]} << 32U | words[1];
}

const char* name_of(LightCase light) noexcept {
  switch (light) {
    case LightCase::same:
      return "same";
    case LightCase::brighter:
      return "brighter";
    case LightCase::led:
      return "led";
    case LightCase::drift:
      return "drift";
    case LightCase::led_fails:
      return "led_fails";
  }
  return "";
}

const char* name_of(Phase phase) noexcept {
  switch (phase) {
    case Phase::before:
      return "before";
    case Phase::moving:
      return "moving";
    case Phase::rest:
      return "rest";
    case Phase::slide:
      return "slide";
    case Phase::after:
      return "after";
  }
  return "";
}

RandomSensor draw_sensor(std::uint64_t seed, int number) {
  RandomSensor sensor;
  sensor.name = fmt::format("s{:02}", number);
  sensor.seed = seed_of(seed, number);
  Draw draw(sensor.seed);
  sim::Scene& scene = sensor.scene;
  scene = thickness::sensor_of(draw.uniform(1, 3));
  scene.sensor = sensor.name;
  scene.presses.clear();
  scene.loop_from_s = scene.loop_to_s = 0;
  sim::GelModel& gel = scene.gel;
  gel.grid_mm = 0.15;
  gel.youngs_modulus_mpa = draw.log_uniform(0.06, 0.25);
  if (draw.chance(0.3)) gel.poisson = draw.uniform(0.48, 0.5);
  if (draw.chance(0.5)) {
    gel.taper_x = draw.uniform(-0.004, 0.004);
    gel.taper_y = draw.uniform(-0.004, 0.004);
  }
  gel.texture = draw.uniform(0.0004, 0.002);
  sim::OpticsModel& optics = scene.optics;
  const double response = draw.uniform(0.85, 1.15);
  for (double* value :
       {&optics.pressed_slope, &optics.pressed_curve, &optics.bulged_slope, &optics.bulged_curve}) {
    *value *= response;
  }
  optics.narrow_mm *= draw.uniform(0.75, 1.3);
  optics.wide_mm *= draw.uniform(0.75, 1.3);
  optics.narrow_weight = draw.uniform(0.6, 0.8);
  if (draw.chance(0.3)) optics.growth = draw.uniform(0, 0.5);
  sim::LightModel& light = scene.light;
  if (draw.chance(0.2)) light.arrangement = sim::Arrangement::sides;
  light.level = draw.uniform(120, 190);
  light.led_radius_mm = draw.uniform(13, 18);
  light.led_distance_mm = draw.uniform(26, 36);
  light.fill = draw.uniform(0.35, 0.6);
  light.vignetting = draw.uniform(0, 0.1);
  sim::CameraModel& camera = scene.camera;
  camera.read_noise = draw.uniform(0.4, 1.1);
  camera.shot_noise = draw.uniform(0.5, 1.0);
  if (draw.chance(0.4)) camera.barrel = draw.uniform(0.04, 0.25);
  return sensor;
}

RandomScene draw_scene(const RandomSensor& sensor, int number) {
  RandomScene out;
  out.name = fmt::format("{}.{:02}", sensor.name, number);
  out.seed = seed_of(sensor.seed, number + 1);
  out.scene = sensor.scene;
  Draw draw(out.seed);
  draw_presses(out, draw);
  draw_light(out, draw);
  return out;
}

std::shared_ptr<const hal::sim::Truth> solve_eased(RandomScene& scene) {
  constexpr double kEase = 0.7;
  constexpr double kSlideStepMm = 0.2;  // a larger step would blend contacts beside each other
  const bool slides = std::ranges::any_of(
      scene.judged, [](const JudgedFrame& frame) { return frame.phase == Phase::slide; });
  if (slides) scene.scene.gel.solve_step_mm = kSlideStepMm;
  double eased = 1;
  auto truth = solve_if_light(scene.scene);
  for (; !truth; truth = solve_if_light(scene.scene)) {
    eased *= kEase;
    for (sim::Press& press : scene.scene.presses) {
      for (sim::PressKey& key : press.keys) {
        if (key.depth_mm > 0) key.depth_mm *= kEase;
      }
    }
  }
  if (eased < 1) scene.what += fmt::format("; eased to {:.2f} of the depth", eased);
  return truth;
}

}  // namespace dtact::whole
