// Normal force, calibrated as a user would by the simulated sensor, a ball or two and a kitchen
// scale, and judged by the force that the simulator's own solution presses with, on other objects.
// A study of 17 real sensors of this family (hqhan03/VBTS_test, 0 to 2.1 N) has a mean absolute
// error of 0.080 N by ridge regression on two scalars and of 0.051 N by a ResNet-18.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/force/force_fit.hpp"
#include "clients/calibrate/force/force_pairs.hpp"
#include "hal/sim/objects.hpp"
#include "tests/accuracy/table/configuration.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::force {
namespace {

namespace sim = hal::sim;

constexpr double kMostNewtons = 2.1;   // as in the study
constexpr std::size_t kFrames = 4;     // averaged at each load
constexpr std::uint64_t kPeriod = 60;  // frames from one load to the next; 60 a second

// Loads from light to heavy, in shares of the layer's thickness.
constexpr std::array<double, 7> kDepths = {0.1, 0.16, 0.22, 0.3, 0.4, 0.5, 0.6};

// Every object at every depth, somewhere within 4 mm of the centre, one after another with nothing
// touching in between; the last second shows the deepest press of a ball of 4 mm, for the list.
sim::Scene scene_of(double thickness_mm, const std::vector<sim::Object>& objects) {
  sim::Scene scene = thickness::sensor_of(thickness_mm);
  scene.layer.solve_step_mm = 5;
  scene.loop_from_s = scene.loop_to_s = 0;
  scene.presses.clear();
  std::mt19937 random(7);
  const auto within = [&](double reach) {
    return reach * (static_cast<double>(random()) / 0x1p31 - 1);  // of 32 bits
  };
  double begin = 1;
  const auto add = [&](const sim::Object& object, double x, double y, double depth) {
    const double turn = within(180);
    scene.presses.push_back({object,
                             {{begin, x, y, 0, turn},
                              {begin + 0.1, x, y, depth, turn},
                              {begin + 0.8, x, y, depth, turn},
                              {begin + 0.9, x, y, 0, turn}}});
    begin += 1;
  };
  for (const sim::Object& object : objects) {
    for (const double share : kDepths) {
      add(object, within(4), within(4), share * thickness_mm);
    }
  }
  add(sim::ball(4), 0, 0, 0.85 * thickness_mm);
  return scene;
}

struct Bench {
  Bench(double thickness_mm, const std::vector<sim::Object>& objects)
      : truth(std::make_shared<const sim::Truth>(scene_of(thickness_mm, objects))),
        sensor(truth, table::configurations()[0], 3) {
    calibration::BallPress press;
    press.reference_q8 = sensor.reference(32);
    press.frames = frames(objects.size() * kDepths.size());
    press.ball_radius_mm = 4;
    press.mm_per_px = table::kMmPerPx;
    press.crop = calibration::Crop{table::kCropCol, table::kCropRow, table::kCrop, table::kCrop};
    made = calibration::build(press);
  }

  [[nodiscard]] static std::uint64_t first_frame(std::size_t load) {
    return 60 + load * kPeriod + 20;
  }
  [[nodiscard]] std::vector<image::Grey8> frames(std::size_t load) {
    std::vector<image::Grey8> all;
    for (std::size_t i = 0; i < kFrames; ++i) all.push_back(sensor.frame(first_frame(load) + i));
    return all;
  }
  /// What the object's loads of up to kMostNewtons look like, with their true force.
  [[nodiscard]] std::vector<Pair> pairs(std::size_t object) {
    const ContactReader reader(made, made.model->reference_q8, 0.1);
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < kDepths.size(); ++i) {
      const std::size_t load = object * kDepths.size() + i;
      const double newtons = truth->force_n(first_frame(load));
      if (newtons > kMostNewtons) continue;
      Pair pair = reader.measure(frames(load), fmt::format("load {}", load));
      if (pair.area_mm2 < 0.5) continue;  // no contact to the daemon
      pair.newtons = newtons;
      pairs.push_back(pair);
    }
    return pairs;
  }

  std::shared_ptr<const sim::Truth> truth;
  table::Sensor sensor;
  calibration::Calibration made;
};

// A kitchen scale shows whole grams.
double on_a_scale(double newtons) { return std::round(newtons / 0.00980665) * 0.00980665; }

struct Errors {
  double sum = 0;
  double expected = 0;
  double worst = 0;
  int count = 0;
  void add(const recon::ForceModel& model, const std::vector<Pair>& pairs) {
    for (const Pair& pair : pairs) {
      const recon::Force said = recon::force_of(model, pair.volume_mm3, pair.area_mm2);
      const double error = std::abs(said.newtons - pair.newtons);
      sum += error;
      worst = std::max(worst, error);
      expected += said.uncertainty_n;
      ++count;
    }
  }
  [[nodiscard]] double mean() const { return sum / count; }
};

std::string line(const std::string& what, const Errors& errors) {
  return fmt::format("{}: {:.3f} N of {} loads, at worst {:.3f}; {:.3f} N stated", what,
                     errors.mean(), errors.count, errors.worst, errors.expected / errors.count);
}

Fit calibrated_by(Bench& bench, const std::vector<std::size_t>& objects) {
  std::vector<Pair> pairs;
  for (const std::size_t object : objects) {
    for (Pair& pair : bench.pairs(object)) {
      pair.newtons = on_a_scale(pair.newtons);
      pairs.push_back(pair);
    }
  }
  return fit_force(pairs, 0.1);
}

struct Judged {
  Fit fit;
  Errors balls;
  Errors others;
};

class ForceAccuracy : public testing::TestWithParam<double> {};

TEST_P(ForceAccuracy, OfObjectsThatHadNoPartInIt) {
  const std::vector<sim::Object> objects = {
      sim::ball(2),   sim::ball(5), sim::disc(2),                         // calibrate
      sim::ball(1.5), sim::ball(3), sim::ball(4),        sim::ball(8),    // other balls
      sim::disc(1.5), sim::cube(4), sim::cylinder(2, 6), sim::m4_nut()};  // not balls
  Bench bench(GetParam(), objects);
  const auto judged = [&](const char* what, const std::vector<std::size_t>& calibrating) {
    Judged result;
    result.fit = calibrated_by(bench, calibrating);
    for (const std::size_t object : {3U, 4U, 5U, 6U}) {
      result.balls.add(result.fit.model, bench.pairs(object));
    }
    for (const std::size_t object : {7U, 8U, 9U, 10U}) {
      result.others.add(result.fit.model, bench.pairs(object));
    }
    fmt::print("layer of {} mm, {}: {} pairs, {:.3f} N of those left out, ridge {:g}\n{}\n{}\n",
               GetParam(), what, result.fit.model.pairs, result.fit.model.error_n, result.fit.ridge,
               line("  other balls", result.balls), line("  other shapes", result.others));
    return result;
  };
  const Judged two_balls = judged("two balls", {0, 1});
  EXPECT_GE(two_balls.balls.count, 12);
  EXPECT_LT(two_balls.balls.mean(), 0.051);
  EXPECT_LT(two_balls.others.mean(), 0.080);
  EXPECT_LT(two_balls.balls.mean(), 2 * two_balls.balls.expected / two_balls.balls.count);
  const Judged ball_and_end = judged("a ball and a flat end", {1, 2});
  EXPECT_LT(ball_and_end.balls.mean(), 0.080);
  EXPECT_LT(ball_and_end.others.mean(), 0.080);
}

// The built-in layer, and one that the law's three terms were not chosen on.
INSTANTIATE_TEST_SUITE_P(Layers, ForceAccuracy, testing::Values(2.0, 1.5));

}  // namespace
}  // namespace dtact::force
