// A press's own gain where the truth is known. On simulated sensors it finds none under an even
// light. Under light that falls to a side the depth stays right, beside the press as well.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"
#include "hal/sim/light_field.hpp"
#include "hal/sim/renderer.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::calibration {
namespace {

namespace sim = hal::sim;

constexpr double kAtX = 1.5;  // mm from the middle, where the ball that calibrates is pressed
constexpr double kAtY = 1.2;

/// The sensor fitted to real images: a ball of 4 mm off the axis at 1.15 to 1.85 s, one of 5 mm far
/// from it at 3.15 to 3.85 s.
sim::Scene scene_of(const std::string& sensor) {
  sim::Scene scene = sim::load_scene(DTACT_SOURCE_DIR "/tests/accuracy/sim/" + sensor + ".toml");
  scene.gel.solve_step_mm = 5;  // only objects at rest are judged
  scene.surface.camera_mm = 0;  // perspective leans, too, and is not the subject
  const auto keys = [](double t, double x, double y, double depth) {
    return std::vector<sim::PressKey>{
        {t, x, y, 0, 0}, {t + 0.1, x, y, depth, 0}, {t + 0.9, x, y, depth, 0}, {t + 1, x, y, 0, 0}};
  };
  scene.presses = {{sim::ball(4), keys(1, kAtX, kAtY, 1.2)}, {sim::ball(5), keys(3, -5, -3, 0.9)}};
  return scene;
}

/// All LEDs, or without the three at the left.
sim::LedLevels light(bool tilted) {
  hal::Light all;
  if (tilted) all.leds[3] = all.leds[4] = all.leds[5] = {};
  return sim::led_levels(all);
}

class Sensor {
 public:
  Sensor(const std::string& sensor, bool tilted)
      : scene_(scene_of(sensor)), renderer_(scene_, 1), light_(light(tilted)) {
    // As bright as with all LEDs, so that there is as much noise.
    if (tilted) renderer_.set_gain(8.0 / 5);
  }

  /// Eight frames from a time on.
  std::vector<image::Grey8> frames(double t) {
    std::vector<image::Grey8> frames;
    const int width = scene_.camera.width;
    const int height = scene_.camera.height;
    for (std::uint64_t i = 0; i < 8; ++i) {
      image::Grey8& frame =
          frames.emplace_back(image::Grey8{width, height, std::vector<std::uint8_t>(pixels())});
      renderer_.render(first(t) + i, light_, frame.pixels.data(), width, height);
    }
    return frames;
  }
  image::Grey16 reference() {
    image::Grey16 mean{scene_.camera.width, scene_.camera.height,
                       std::vector<std::uint16_t>(pixels())};
    for (const image::Grey8& frame : frames(0)) {
      for (std::size_t i = 0; i < pixels(); ++i) {
        mean.pixels[i] = static_cast<std::uint16_t>(mean.pixels[i] + 32 * frame.pixels[i]);
      }
    }
    return mean;
  }
  /// Mean distance from the true indentation in contact with a ball, mm.
  double error(const recon::Model& model, double t) {
    const std::vector<float> um = mean_depth_um(model, reference().pixels, frames(t));
    std::vector<float> truth;
    std::vector<std::uint8_t> in_contact;
    renderer_.truth().indentation_mm(first(t), truth);
    renderer_.truth().contact(first(t), in_contact);
    double sum = 0;
    double count = 0;
    for (std::size_t i = 0; i < pixels(); ++i) {
      if (in_contact[i] == 0 || std::isnan(um[i])) continue;
      sum += std::abs(0.001 * um[i] - truth[i]);
      count += 1;
    }
    return sum / count;
  }
  [[nodiscard]] const sim::Scene& scene() const { return scene_; }

 private:
  [[nodiscard]] std::size_t pixels() const {
    return static_cast<std::size_t>(scene_.camera.width) *
           static_cast<std::size_t>(scene_.camera.height);
  }
  [[nodiscard]] std::uint64_t first(double t) const {
    return static_cast<std::uint64_t>(std::lround(t * scene_.camera.fps));
  }

  sim::Scene scene_;
  sim::Renderer renderer_;
  sim::LedLevels light_;
};

/// Errors of a calibration from the first press, at that press and beside it, mm.
struct Errors {
  double here = 0;
  double beside = 0;
};
Errors errors_of(Sensor& sensor, const recon::Model& model) {
  return {sensor.error(model, 1.2), sensor.error(model, 3.2)};
}

BallPress press_of(Sensor& sensor) {
  BallPress press;
  press.reference_q8 = sensor.reference();
  press.frames = sensor.frames(1.2);
  press.ball_radius_mm = 4;
  press.mm_per_px = sensor.scene().camera.mm_per_px;
  return press;
}

/// The LUT only, about the centroid.
recon::Model lut_alone(const BallPress& press, const recon::Model& made) {
  recon::Model model = made;
  model.gain = {};
  const SettledPress settled = settle(model, press.reference_q8.pixels, press.frames, 4);
  model.lut = fit_lut(settled.map, settled.contact);
  return model;
}

class SimulatedPressAsymmetry : public testing::TestWithParam<const char*> {};

TEST_P(SimulatedPressAsymmetry, EvenLightHasNone) {
  Sensor sensor(GetParam(), false);
  BallPress press = press_of(sensor);
  press.may_share_light = true;
  PressChoices choices;
  const Calibration made = build(press, &choices);
  fmt::print("{}\n", choices.describe());
  EXPECT_EQ(choices.press_asymmetry.gain.order, AsymmetryOrder::none);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none);
}

TEST_P(SimulatedPressAsymmetry, UnderATiltedLightMiddleAndTiltAreFound) {
  Sensor sensor(GetParam(), true);
  const BallPress press = press_of(sensor);
  const Calibration made = build(press);
  const SettledPress settled = settle(*made.model, press.reference_q8.pixels, press.frames, 4);
  const PressAsymmetry gain =
      fit_asymmetry(sure_samples(settled.map, settled.contact), 4, AsymmetryOrder::plane);
  const SymmetricPress level = without_asymmetry(settled.map, settled.contact, gain);
  const auto off = [&](const Contact& contact) {
    const double mm = press.mm_per_px;
    return std::hypot(mm * (contact.col - 319.5) - kAtX, mm * (contact.row - 239.5) - kAtY);
  };
  fmt::print("centroid {:.3f} mm off, middle {:.3f}; plane {:.4f}, {:.4f} per mm\n",
             off(settled.contact), off(level.contact), gain.factors[0], gain.factors[1]);
  EXPECT_GT(off(settled.contact), 0.015);
  EXPECT_LT(off(level.contact), 0.01);
  EXPECT_LT(gain.factors[0], -0.008) << "less light at the left: darkening counts more there";
  EXPECT_NEAR(gain.factors[1], 0, 0.004);
}

/// Errors of the LUT only, about the centroid, and of the present method.
struct BeforeAndNow {
  Errors before;
  Errors now;
};
BeforeAndNow compare(const std::string& name, bool tilted) {
  Sensor sensor(name, tilted);
  BallPress press = press_of(sensor);
  press.may_share_light = true;
  const Calibration made = build(press);
  const BeforeAndNow e{errors_of(sensor, lut_alone(press, *made.model)),
                       errors_of(sensor, *made.model)};
  fmt::print("{}, {} light: LUT alone {:.4f} mm, beside the press {:.4f}; now {:.4f}, {:.4f}\n",
             name, tilted ? "tilted" : "even", e.before.here, e.before.beside, e.now.here,
             e.now.beside);
  return e;
}

TEST_P(SimulatedPressAsymmetry, TheTruthStaysRight) {
  const BeforeAndNow even = compare(GetParam(), false);
  EXPECT_LE(even.now.here, even.before.here + 0.001);
  EXPECT_LE(even.now.beside, even.before.beside + 0.001);
  // The error of one press's zero stays; the error from the tilt vanishes.
  const BeforeAndNow tilted = compare(GetParam(), true);
  EXPECT_LE(tilted.now.here, even.now.here + 0.005);
  EXPECT_LE(tilted.now.beside, even.now.beside + 0.005);
  EXPECT_GT(tilted.before.beside, even.before.beside + 0.03);
}

INSTANTIATE_TEST_SUITE_P(Sensors, SimulatedPressAsymmetry, testing::Values("sensor_a", "sensor_b"),
                         [](const auto& sensor) { return std::string(sensor.param); });

}  // namespace
}  // namespace dtact::calibration
