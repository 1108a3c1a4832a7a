#include "tests/accuracy/sim/press_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "hal/sim/light_field.hpp"
#include "hal/sim/optics.hpp"
#include "hal/sim/truth.hpp"
#include "tests/accuracy/sim/nelder_mead.hpp"

namespace dtact::accuracy {
namespace {

namespace sim = hal::sim;

// High-pass noise of one frame of sensor_a, grey levels (shared/data/README.md).
constexpr double kNoiseOfOne = 0.98;
// Every third pixel of every third row is enough for the rings while searching.
constexpr int kEvery = 3;

sim::Scene scene_for(const Sensor& sensor, const Image& image) {
  sim::Scene scene = sim::default_scene();
  scene.sensor = sensor.name;
  scene.loop_to_s = 0;
  scene.presses.clear();
  scene.camera.width = image.width;
  scene.camera.height = image.height;
  scene.camera.fps = 30;
  scene.camera.mm_per_px = sensor.mm_per_px;
  return scene;
}

// Level and vignetting are linear in the reference image once the LEDs' geometry is given.
void fit_light(const Image& reference, sim::Scene& scene) {
  scene.light.level = 160;
  scene.light.vignetting = 0;
  std::vector<std::uint16_t> light(reference.pixels.size());
  sim::LightField(scene).compute(sim::led_levels({}), light);
  double aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
  for (int y = 0; y < reference.height; ++y) {
    for (int x = 0; x < reference.width; ++x) {
      const auto i = reference.index(x, y);
      const double dx = x - (reference.width - 1) / 2.0;
      const double dy = y - (reference.height - 1) / 2.0;
      const double corner = std::hypot(reference.width, reference.height) / 2;
      const double a = light[i] / 64.0;
      const double b = -a * (dx * dx + dy * dy) / (corner * corner);
      aa += a * a;
      ab += a * b;
      bb += b * b;
      ay += a * reference.pixels[i];
      by += b * reference.pixels[i];
    }
  }
  const double determinant = aa * bb - ab * ab;
  const double scale = (ay * bb - by * ab) / determinant;
  scene.light.vignetting = std::max((by * aa - ay * ab) / determinant / scale, 0.0);
  scene.light.level *= scale;
}

// Sets white noise whose high-pass standard deviation is `high_pass` in one rounded frame, and as
// near as possible in the mean of ten. The blur takes 6 % off the variance of white noise (1 −
// 2·0.0398 + 0.0199), rounding adds 1/12.
void fit_noise(double high_pass_of_ten, double mean_grey, sim::Scene& scene) {
  const double one = kNoiseOfOne * kNoiseOfOne / 0.94 - 1.0 / 12;
  const double ten = (high_pass_of_ten * high_pass_of_ten / 0.94 - 1.0 / 12) * 10;
  const double variance = (one + ten) / 2;
  const double shot = scene.camera.shot_noise * scene.camera.shot_noise * mean_grey / 160;
  scene.camera.read_noise = std::sqrt(std::max(variance - shot, 0.0));
}

double outside(double value, double low, double high) {
  return std::max({low - value, value - high, 0.0});
}

// The profile as a function of the optics' seven parameters, for one solved press.
class PressedProfile {
 public:
  PressedProfile(const sim::Scene& scene, const Centre& centre,
                 const std::vector<std::uint16_t>& light)
      : scene_(scene),
        centre_(centre),
        light_(light),
        truth_(scene),
        indentation_(truth_.grid().size()),
        loss_(truth_.grid().size()),
        row_(static_cast<std::size_t>(scene.camera.width)) {
    truth_.blend(truth_.moment(0), indentation_);
  }

  Profile operator()(const sim::OpticsModel& model) {
    sim::Optics(model, truth_.grid()).run(indentation_, loss_);
    Image change{scene_.camera.width / kEvery, scene_.camera.height / kEvery, {}};
    for (int y = 0; y < change.height; ++y) {
      truth_.pixels().sample_row(y * kEvery, loss_, row_);
      const std::size_t first = static_cast<std::size_t>(y) * kEvery * row_.size();
      for (std::size_t x = 0; x < static_cast<std::size_t>(change.width); ++x) {
        change.pixels.push_back(light_[first + x * kEvery] / 64.0 * row_[x * kEvery] / 32768);
      }
    }
    return radial_profile(change, {centre_.x / kEvery, centre_.y / kEvery},
                          scene_.camera.mm_per_px * kEvery);
  }

 private:
  const sim::Scene& scene_;
  Centre centre_;
  const std::vector<std::uint16_t>& light_;
  sim::Truth truth_;
  std::vector<std::int16_t> indentation_;
  std::vector<std::int16_t> loss_;
  std::vector<std::int16_t> row_;
};

sim::OpticsModel to_model(const std::vector<double>& p) {
  sim::OpticsModel optics;
  optics.pressed_slope = p[0];
  optics.pressed_curve = p[1];
  optics.bulged_slope = p[2];
  optics.bulged_curve = p[3];
  optics.narrow_mm = p[4];
  optics.wide_mm = p[5];
  optics.narrow_weight = p[6];
  return optics;
}

// Distance of the optics from the physical range; 0 inside. In shared/physics.md's terms: a mild
// curve (the slope at the deepest press is at least half of that at the surface), steeper on the
// bulge than on the pressed side, and a second scattering that is wider and weaker.
double unphysical(const std::vector<double>& p, double thickness_mm) {
  const double deep_slope = p[0] + 2 * p[1] * 0.9 * thickness_mm;
  const double bulge_slope = p[2] - 2 * p[3] * 0.2 * thickness_mm;
  return outside(p[0], 0.02, 1) + outside(deep_slope, 0.5 * p[0], 10) + outside(p[2], p[0], 4) +
         outside(bulge_slope, 0.5 * p[2], 10) + outside(p[4], 0.2, 0.8) + outside(p[5], 0.9, 3) +
         outside(p[6], 0.5, 1);
}

}  // namespace

Fit fit_sensor(const Sensor& sensor, const BallPress& real) {
  Fit fit;
  fit.scene = scene_for(sensor, real.reference);
  fit_light(real.reference, fit.scene);
  double mean_grey = 0;
  for (const double pixel : real.reference.pixels) mean_grey += pixel;
  mean_grey /= static_cast<double>(real.reference.pixels.size());
  fit_noise(high_pass_noise(real.reference), mean_grey, fit.scene);

  const Centre centre = centroid(real);
  fit.x_mm = (centre.x - (real.reference.width - 1) / 2.0) * sensor.mm_per_px;
  fit.y_mm = (centre.y - (real.reference.height - 1) / 2.0) * sensor.mm_per_px;
  std::vector<std::uint16_t> light(real.reference.pixels.size());
  sim::LightField(fit.scene).compute(sim::led_levels({}), light);
  const Profile target = radial_profile(change_of(real), centre, sensor.mm_per_px);

  // Contact is solved for a depth and a thickness; the optics' parameters are fitted inside, where
  // an evaluation is cheap. Start: slopes of 35 and 65 grey levels of 165 per mm.
  std::vector<double> optics = {0.22, -0.01, 0.40, -0.5, 0.3, 1.8, 0.7};
  fit.rms = std::numeric_limits<double>::infinity();
  const auto cost_of_press = [&](const std::vector<double>& press) {
    const double penalty = outside(press[0], 1.4, 0.89 * press[1]) + outside(press[1], 1.8, 2.7);
    if (penalty > 0) return 100 * (1 + penalty);
    sim::Scene scene = fit.scene;
    scene.gel.thickness_mm = press[1];
    scene.presses = {{sim::ball(kBallRadius_mm), {{0, fit.x_mm, fit.y_mm, press[0], 0}}}};
    PressedProfile profile(scene, centre, light);
    const auto cost_of_optics = [&](const std::vector<double>& p) {
      const double excess = unphysical(p, press[1]);
      return excess > 0 ? 100 * (1 + excess) : rms_difference(profile(to_model(p)), target);
    };
    const std::vector<double> step = {0.03, -0.01, 0.1, -0.3, 0.1, -0.3, -0.1};
    for (int round = 0; round < 2; ++round) {  // a new simplex escapes from a collapsed one
      optics = nelder_mead(cost_of_optics, optics, step, 300, 1e-4);
    }
    const double rms = cost_of_optics(optics);
    if (rms < fit.rms) {
      fit.rms = rms;
      fit.depth_mm = press[0];
      scene.optics = to_model(optics);
      fit.scene = scene;
      fmt::print("{}: depth {:.3f} mm, gel {:.3f} mm: {:.3f} grey levels RMS\n", sensor.name,
                 press[0], press[1], rms);
    }
    return rms;
  };
  (void)nelder_mead(cost_of_press, {1.7, 2.2}, {0.15, 0.2}, 40, 1e-3);
  return fit;
}

}  // namespace dtact::accuracy
