#include "tests/accuracy/thickness/thickness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <numbers>

#include "clients/calibrate/fit/build.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/sim/objects.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/table/trial.hpp"

namespace dtact::thickness {
namespace {

constexpr std::array<double, 12> kPitches = {4,    3,   2.5, 2,   1.75, 1.5,
                                             1.25, 1.0, 0.8, 0.6, 0.5,  0.4};
constexpr double kPlateMm = 6;
constexpr std::size_t kFrames = 8;

/// An object that comes down after one second and stays.
hal::sim::Scene with(hal::sim::Scene scene, const hal::sim::Object& object, double depth_mm) {
  scene.presses = {{object, {{1, 0, 0, 0, 0}, {1.1, 0, 0, depth_mm, 0}}}};
  scene.gel.grid_mm = 0.1;
  scene.gel.solve_step_mm = 5;
  scene.loop_from_s = scene.loop_to_s = 0;
  return scene;
}

constexpr std::uint64_t kPressed = 90;

class Bench {
 public:
  explicit Bench(double thickness_mm) : scene_(sensor_of(thickness_mm)), depth_(kPixels) {
    const double depth = 0.85 * thickness_mm;
    auto sensor = sensor_with(hal::sim::ball(4), depth);
    calibration::BallPress press;
    press.reference_q8 = sensor.reference(32);
    for (std::size_t i = 0; i < kFrames; ++i) press.frames.push_back(sensor.frame(kPressed + i));
    press.ball_radius_mm = 4;
    press.mm_per_px = table::kMmPerPx;
    press.view = table::view_of(scene_);
    press.crop = calibration::Crop{table::kCropCol, table::kCropRow, table::kCrop, table::kCrop};
    reconstructor_ = std::make_unique<recon::Reconstructor>(calibration::build(press).model);
  }

  Press press(double depth_mm) {
    const table::TruePress truth = look(hal::sim::ball(5), depth_mm);
    const table::Error error = table::against_indentation(depth_, truth);
    const double all = static_cast<double>(error.pixels + error.untrusted);
    return {depth_mm, error.mean_mm(), static_cast<double>(error.untrusted) / all};
  }

  Groove groove(double pitch_mm, double depth_mm) {
    const double relief = std::min(0.4, depth_mm);
    const table::TruePress truth = look(hal::sim::grating(pitch_mm, relief, kPlateMm), depth_mm);
    return {pitch_mm,
            contrast(pitch_mm,
                     [&](std::size_t i) { return static_cast<double>(truth.indentation_mm[i]); }),
            contrast(pitch_mm, [&](std::size_t i) { return 0.001 * depth_[i]; })};
  }

 private:
  static constexpr auto kPixels = std::size_t{table::kCrop} * table::kCrop;

  table::Sensor sensor_with(const hal::sim::Object& object, double depth_mm) {
    return {std::make_shared<const hal::sim::Truth>(with(scene_, object, depth_mm)),
            table::configurations()[0], 1};
  }

  /// Converts one frame, decoded like in the daemon, into depth_.
  table::TruePress look(const hal::sim::Object& object, double depth_mm) {
    auto sensor = sensor_with(object, depth_mm);
    auto luma = sensor.frame(kPressed + kFrames).pixels;
    luma.resize(luma.size() + recon::kLumaPadding);
    reconstructor_->run(luma.data(), table::kFrameWidth, depth_);
    return table::true_press(sensor.truth(), kPressed);
  }

  /// Amplitude of the first harmonic of `value` along x over the middle of the plate, doubled:
  /// ridge minus groove of a sine, the same measure for truth and map.
  template <typename Value>
  [[nodiscard]] double contrast(double pitch_mm, const Value& value) const {
    const double periods = std::max(1.0, std::floor(0.6 * kPlateMm / pitch_mm));
    const int half_width = static_cast<int>(std::lround(periods * pitch_mm / 2 / table::kMmPerPx));
    const int half_height = static_cast<int>(1.0 / table::kMmPerPx);
    double c = 0;
    double s = 0;
    double n = 0;
    for (int y = -half_height; y < half_height; ++y) {
      for (int x = -half_width; x < half_width; ++x) {
        const std::size_t i = static_cast<std::size_t>(table::kCrop / 2 + y) * table::kCrop +
                              static_cast<std::size_t>(table::kCrop / 2 + x);
        if (depth_[i] == recon::kUntrusted) continue;
        const double angle = 2 * std::numbers::pi * x * table::kMmPerPx / pitch_mm;
        c += value(i) * std::cos(angle);
        s += value(i) * std::sin(angle);
        ++n;
      }
    }
    return n > 0 ? 4 * std::hypot(c, s) / n : 0;
  }

  hal::sim::Scene scene_;
  std::unique_ptr<recon::Reconstructor> reconstructor_;
  std::vector<std::int16_t> depth_;
};

}  // namespace

std::optional<double> Result::finest_mm() const {
  std::optional<double> finest;
  for (const Groove& groove : grooves) {
    if (!groove.resolved()) break;
    finest = groove.pitch_mm;
  }
  return finest;
}

std::optional<double> Result::deepest_mm() const {
  std::optional<double> deepest;
  for (const Press& press : presses) {
    if (press.measured()) deepest = press.depth_mm;
  }
  return deepest;
}

Result measure(double thickness_mm) {
  Bench bench(thickness_mm);
  Result result;
  result.thickness_mm = thickness_mm;
  for (const double pitch : kPitches) {
    result.grooves.push_back(bench.groove(pitch, std::min(0.6, 0.5 * thickness_mm)));
  }
  // The simulator's objects reach at most 0.9 of the gel.
  const double most = 0.9 * thickness_mm;
  for (int tenths = 4; 0.1 * tenths < most; ++tenths) {
    result.presses.push_back(bench.press(0.1 * tenths));
  }
  return result;
}

std::string to_csv(const std::vector<Result>& results) {
  std::string out = "thickness_mm,kind,value_mm,true_mm,shown_mm,error_mm,untrusted,ok\n";
  auto to = std::back_inserter(out);
  for (const Result& result : results) {
    for (const Groove& g : result.grooves) {
      fmt::format_to(to, "{},groove,{:.2f},{:.4f},{:.4f},,,{:d}\n", result.thickness_mm, g.pitch_mm,
                     g.true_mm, g.shown_mm, g.resolved());
    }
    for (const Press& p : result.presses) {
      fmt::format_to(to, "{},press,{:.2f},,,{:.4f},{:.3f},{:d}\n", result.thickness_mm, p.depth_mm,
                     p.error_mm, p.untrusted, p.measured());
    }
    fmt::format_to(to, "{},finest,{:.2f},,,,,\n{},deepest,{:.2f},,,,,\n", result.thickness_mm,
                   result.finest_mm().value_or(0), result.thickness_mm,
                   result.deepest_mm().value_or(0));
  }
  return out;
}

}  // namespace dtact::thickness
