// Effect of sharpening on the pins of a board on real sensors.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"
#include "tests/accuracy/real/folder_evaluation.hpp"
#include "tests/accuracy/real/press_images.hpp"

namespace dtact::ctl {
namespace {

using calibration::Calibration;

/// A pin in the depth map, the mean of those that are completely inside of it. Pins are 2.5 mm
/// apart, 0.6 mm in radius, with a hemisphere as tip.
struct MeanPin {
  /// Distance from the pin's axis, millimetres, where the depth has fallen halfway from the tip's
  /// to the least.
  double half_mm = 0;
  /// Steepest fall, millimetres a millimetre.
  double slope = 0;
  /// Height of the tip above the least depth around it, millimetres.
  double height_mm = 0;
  /// Depth halfway to the next pin (along the rows and columns) minus the least depth
  /// nearer to the pin, as a share of the height. Displaced gel rises evenly towards
  /// there; a filter that rings leaves a trough around the pin.
  double trough = 0;
};

constexpr double kStepMm = 0.05;
constexpr double kHalfwayMm = 1.25;

/// Depth against the distance from the pins' axes, millimetres, in steps of kStepMm up to halfway.
std::vector<double> mean_profile(const std::vector<float>& um, const PinPress& pins,
                                 const Calibration& calibration) {
  const recon::Model& model = *calibration.model;
  const int width = model.rectify.width;
  const int height = model.rectify.height;
  const recon::MapPlace place{calibration.crop_col, calibration.crop_row, width, height,
                              model.mm_per_px};
  constexpr int kDirections = 32;
  const int steps = static_cast<int>(std::lround(kHalfwayMm / kStepMm)) + 1;
  std::vector<double> mean(static_cast<std::size_t>(steps));
  int count = 0;
  for (const Mark& mark : pins.marks) {
    std::vector<double> one(mean.size());
    for (std::size_t i = 0; i < one.size(); ++i) {
      for (int k = 0; k < kDirections; ++k) {
        const double angle = 2 * std::numbers::pi * k / kDirections;
        const double r = kStepMm * static_cast<double>(i);
        const recon::Point pixel =
            map_pixel(pins.lens.lens, place,
                      {mark.mm.x + r * std::cos(angle), mark.mm.y + r * std::sin(angle)});
        const int col = static_cast<int>(std::floor(pixel.x));
        const int row = static_cast<int>(std::floor(pixel.y));
        if (col < 0 || row < 0 || col + 1 >= width || row + 1 >= height) {
          one[i] = std::nan("");
          break;
        }
        const auto at = [&](int dx, int dy) {
          return 0.001 * um[static_cast<std::size_t>(row + dy) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(col + dx)];
        };
        const double right = pixel.x - col;
        const double down = pixel.y - row;
        one[i] += ((1 - down) * ((1 - right) * at(0, 0) + right * at(1, 0)) +
                   down * ((1 - right) * at(0, 1) + right * at(1, 1))) /
                  kDirections;
      }
    }
    if (std::ranges::any_of(one, [](double v) { return std::isnan(v); })) continue;
    ++count;
    for (std::size_t i = 0; i < one.size(); ++i) mean[i] += one[i];
  }
  EXPECT_GE(4 * count, 3 * static_cast<int>(pins.marks.size()));
  for (double& depth : mean) depth /= std::max(1, count);
  return mean;
}

MeanPin look(const std::vector<double>& profile) {
  MeanPin pin;
  const double least = *std::ranges::min_element(profile);
  pin.height_mm = profile.front() - least;
  pin.trough = (profile.back() - least) / pin.height_mm;
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    pin.slope = std::max(pin.slope, (profile[i] - profile[i + 1]) / kStepMm);
    const double half = least + pin.height_mm / 2;
    if (pin.half_mm == 0 && profile[i + 1] < half) {
      const double part = (profile[i] - half) / (profile[i] - profile[i + 1]);
      pin.half_mm = kStepMm * (static_cast<double>(i) + part);
    }
  }
  return pin;
}

/// The board of one sensor in the daemon's depth: not sharpened, once and twice.
struct Pins {
  std::vector<MeanPin> mean;
  std::vector<double> spread;  ///< Spread of their depths.
};

Pins read_board(const std::string& name, const FolderEvaluation& e,
                const Calibration& calibration) {
  Pins read;
  const auto reference = e.board_reference.mean_q8().pixels;
  const auto frames = e.board.frames();
  for (int steps = 0; steps <= recon::kMaxSharpeningSteps; ++steps) {
    const std::vector<float> um =
        calibration::mean_depth_um(*calibration.model, reference, frames, steps);
    read.mean.push_back(look(mean_profile(um, *e.pins, calibration)));
    read.spread.push_back(
        read_pins(*e.pins, e.gain, calibration, reference, frames, {}, steps).spread);
    const MeanPin& pin = read.mean.back();
    fmt::print(
        "{}, {} steps: {:.3f} mm high, half of it at {:.3f} mm, steepest {:.2f}, trough {:.1f} %, "
        "spread {:.1f} %\n",
        name, steps, pin.height_mm, pin.half_mm, pin.slope, 100 * pin.trough,
        100 * read.spread.back());
  }
  return read;
}

/// A calibration with the gel that was fitted to the sensor's own ball.
Calibration by_gel(const FolderEvaluation& e) {
  calibration::BallPresses presses;
  presses.reference_q8 = e.ball_reference.mean_q8();
  presses.presses = {{"ball.png", e.ball_images.frames(), {}}};
  presses.ball_radius_mm = 4;
  presses.lens = e.pins->lens.lens;
  presses.gain_specified = true;
  presses.mm_per_px = recon::central_mm_per_px(e.pins->lens.lens);
  const calibration::FittedCalibration made = calibration::build_model(presses, e.gain.gain);
  const calibration::GelModel& gel = made.fit.gel;
  fmt::print("gel {:.2f} mm, scattering {:.2f} and {:.2f} mm, {:.2f} of it narrow\n",
             gel.thickness_mm, gel.scattering.narrow_mm, gel.scattering.wide_mm,
             gel.scattering.narrow_weight);
  return made.calibration;
}

/// The same with the LUTs and the scattering of another sensor.
Calibration by_gel_of(const Calibration& other, const FolderEvaluation& e) {
  const recon::Lens& lens = e.pins->lens.lens;
  Calibration made = calibration::empty_calibration(e.board_reference.mean_q8(), std::nullopt,
                                                    recon::central_mm_per_px(lens), lens);
  recon::Model model = *made.model;
  model.lut = other.model->lut;
  model.scattering = other.model->scattering;
  model.sharpened = other.model->sharpened;
  model.gain = calibration::gain_on_map(e.gain.gain, made);
  made.model = std::make_shared<const recon::Model>(std::move(model));
  return made;
}

/// A sensor's folder, and its calibration by the gel where the folder has a ball: made once for all
/// tests.
struct Evaluated : FolderEvaluation {
  std::optional<Calibration> gel;
};
const Evaluated* evaluated(const char* sensor) {
  static std::map<std::string, Evaluated> all;
  const auto folder = sensor_folder(sensor);
  if (!folder) return nullptr;
  const auto found = all.find(sensor);
  if (found != all.end()) return &found->second;
  Evaluated e{evaluate_folder(*folder, {}, 4.0), std::nullopt};
  if (e.calibration) e.gel = by_gel(e);
  return &all.emplace(sensor, std::move(e)).first->second;
}

/// Each step makes pins narrower without a trough. `once` and `twice` limit how much more of their
/// mean the depths may differ by after one step and two; the goal is no more, which two steps miss.
void expect_narrower(const Pins& read, double once, double twice) {
  for (std::size_t i = 0; i + 1 < read.mean.size(); ++i) {
    EXPECT_LT(read.mean[i + 1].half_mm, read.mean[i].half_mm);
  }
  for (const MeanPin& pin : read.mean) EXPECT_LT(pin.trough, 0.01);
  EXPECT_LT(read.spread[1], read.spread[0] + once);
  EXPECT_LT(read.spread[2], read.spread[0] + twice);
}

void expect_steeper(const Pins& read) {
  for (std::size_t i = 0; i + 1 < read.mean.size(); ++i) {
    EXPECT_GT(read.mean[i + 1].slope, 1.15 * read.mean[i].slope);
  }
}

TEST(SharpPins, SensorA) {
  const Evaluated* e = evaluated("sensor_a");
  if (!e) GTEST_SKIP() << "the real images are not beside the repository";
  ASSERT_TRUE(e->pins && e->gel);
  const Pins read = read_board("sensor_a", *e, *e->gel);
  expect_narrower(read, 0.005, 0.015);
  expect_steeper(read);
}

// The fit of its asymmetric press has light scattered 3.4 mm wide, which blurs no edge of a pin.
TEST(SharpPins, SensorBIsHardlySteeper) {
  const Evaluated* e = evaluated("sensor_b");
  if (!e) GTEST_SKIP() << "the real images are not beside the repository";
  ASSERT_TRUE(e->pins && e->gel);
  const Pins read = read_board("sensor_b", *e, *e->gel);
  expect_narrower(read, 0.005, 0.005);
  EXPECT_GT(read.mean[2].slope, read.mean[0].slope);
}

TEST(SharpPins, SensorCByTheGelOfSensorA) {
  const Evaluated* a = evaluated("sensor_a");
  const Evaluated* c = evaluated("sensor_c");
  if (!a || !c) GTEST_SKIP() << "the real images are not beside the repository";
  ASSERT_TRUE(a->pins && a->gel && c->pins);
  const Pins read = read_board("sensor_c", *c, by_gel_of(*a->gel, *c));
  expect_narrower(read, 0.005, 0.015);
  expect_steeper(read);
}

}  // namespace
}  // namespace dtact::ctl
