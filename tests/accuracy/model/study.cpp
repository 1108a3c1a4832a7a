#include "tests/accuracy/model/study.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/difference.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/methods.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::model_study {
namespace {

constexpr double kMost = 0.85;  // of the layer

Specimen with_optics(std::string name, double thickness_mm, const hal::sim::OpticsModel& optics) {
  hal::sim::Scene scene = hal::sim::default_scene();
  scene.layer.thickness_mm = thickness_mm;
  scene.optics = optics;
  return {std::move(name), std::move(scene)};
}

class Reader {
 public:
  explicit Reader(std::shared_ptr<const recon::Model> model)
      : model_(std::move(model)), reconstructor_(model_), depth_(model_->rectify.entries.size()) {}

  void read(const image::Grey8& frame, const table::TruePress& truth) {
    std::vector<std::uint8_t> luma = frame.pixels;
    luma.resize(luma.size() + recon::kLumaPadding);
    reconstructor_.run(luma.data(), table::kFrameWidth, depth_);
    error_ += table::against_indentation(depth_, truth);
    for (std::size_t i = 0; i < depth_.size(); ++i) {
      if (truth.contact[i] == 0 || depth_[i] == recon::kUntrusted) continue;
      bias_ += 0.001 * depth_[i] - static_cast<double>(truth.indentation_mm[i]);
    }
  }
  [[nodiscard]] double mean_mm() const { return error_.mean_mm(); }
  [[nodiscard]] double bias_mm() const { return bias_ / static_cast<double>(error_.pixels); }

 private:
  std::shared_ptr<const recon::Model> model_;
  recon::Reconstructor reconstructor_;
  std::vector<std::int16_t> depth_;
  table::Error error_;
  double bias_ = 0;
};

/// A separable Gaussian, the border replicated.
std::vector<float> gaussian(const std::vector<float>& map, int width, int height, double sigma_px) {
  const int reach = static_cast<int>(std::ceil(3.5 * sigma_px));
  std::vector<float> taps;
  float sum = 0;
  for (int k = -reach; k <= reach; ++k) {
    taps.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma_px * sigma_px))));
    sum += taps.back();
  }
  for (float& tap : taps) tap /= sum;
  const auto index = [width](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  };
  std::vector<float> between(map.size());
  std::vector<float> out(map.size());
  for (int y = 0; y < height; ++y) {
    for (int k = -reach; k <= reach; ++k) {
      const float tap = taps[static_cast<std::size_t>(k + reach)];
      const int from = std::clamp(y + k, 0, height - 1);
      for (int x = 0; x < width; ++x) between[index(x, y)] += tap * map[index(x, from)];
    }
  }
  std::vector<float> line(static_cast<std::size_t>(width + 2 * reach));
  for (int y = 0; y < height; ++y) {
    for (int x = -reach; x < width + reach; ++x) {
      line[static_cast<std::size_t>(x + reach)] = between[index(std::clamp(x, 0, width - 1), y)];
    }
    for (int k = 0; k <= 2 * reach; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      for (int x = 0; x < width; ++x) {
        out[index(x, y)] += tap * line[static_cast<std::size_t>(x + k)];
      }
    }
  }
  return out;
}

/// Reads a frame through the filter's steps, one after the other: x ← x + L − Hx.
void read_sharpened(const recon::Model& model, const image::Grey8& frame,
                    const table::TruePress& truth, std::array<table::Error, 2>& errors) {
  const calibration::DifferenceMap map =
      calibration::smoothed_difference(model, model.reference_q8, {&frame, 1});
  const recon::Scattering& scattering = *model.scattering;
  const auto narrow = static_cast<float>(scattering.narrow_weight);
  std::vector<float> x = map.levels;
  for (std::size_t step = 0; step < errors.size(); ++step) {
    const std::vector<float> sharp =
        gaussian(x, map.width, map.height, scattering.narrow_mm / map.mm_per_px);
    const std::vector<float> wide =
        gaussian(x, map.width, map.height, scattering.wide_mm / map.mm_per_px);
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] += map.levels[i] - narrow * sharp[i] - (1 - narrow) * wide[i];
    }
    const recon::DepthList& list = model.sharpened[step].list;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (truth.contact[i] == 0) continue;
      const long entry = std::lround(x[i] * recon::kEntriesPerLevel) - list.first_q6;
      const long last = static_cast<long>(list.um.size()) - 1;
      errors[step].add(0.001 * list.um[static_cast<std::size_t>(std::clamp(entry, 0L, last))] -
                       static_cast<double>(truth.indentation_mm[i]));
    }
  }
}

double stated_mm(const recon::Model& model, double depth_mm) {
  double nearest = 1e9;
  double stated = 0;
  for (const auto& row : model.uncertainty) {
    if (std::abs(row.depth_mm - depth_mm) >= nearest) continue;
    nearest = std::abs(row.depth_mm - depth_mm);
    stated = 0.001 * row.error_um;
  }
  return stated;
}

}  // namespace

std::vector<Specimen> specimens() {
  std::vector<Specimen> all;
  for (const double thickness : {1.5, 2.0, 2.5, 3.0}) {
    all.push_back(
        {std::to_string(thickness).substr(0, 3) + " mm", thickness::sensor_of(thickness)});
  }
  // Chosen before anything was measured on them: curved and steep, flat and wide, a kink at zero,
  // hardly any narrow light.
  all.push_back(with_optics("curved", 2.0,
                            {.pressed_slope = 0.26,
                             .pressed_curve = -0.05,
                             .bulged_slope = 0.26,
                             .bulged_curve = -0.6,
                             .narrow_mm = 0.25,
                             .wide_mm = 1.0,
                             .narrow_weight = 0.8,
                             .knots = {},
                             .slopes = {}}));
  all.push_back(with_optics("wide", 2.3,
                            {.pressed_slope = 0.15,
                             .pressed_curve = 0.01,
                             .bulged_slope = 0.2,
                             .bulged_curve = -0.9,
                             .narrow_mm = 0.4,
                             .wide_mm = 1.9,
                             .narrow_weight = 0.65,
                             .knots = {},
                             .slopes = {}}));
  all.push_back(with_optics("kinked", 1.8,
                            {.pressed_slope = 0.19,
                             .pressed_curve = 0.0,
                             .bulged_slope = 0.4,
                             .bulged_curve = -1.0,
                             .narrow_mm = 0.3,
                             .wide_mm = 1.4,
                             .narrow_weight = 0.7,
                             .knots = {},
                             .slopes = {}}));
  all.push_back(with_optics("blurred", 2.4,
                            {.pressed_slope = 0.17,
                             .pressed_curve = 0.0,
                             .bulged_slope = 0.3,
                             .bulged_curve = -1.2,
                             .narrow_mm = 0.55,
                             .wide_mm = 1.3,
                             .narrow_weight = 0.55,
                             .knots = {},
                             .slopes = {}}));
  return all;
}

Result measure(const Specimen& specimen, std::uint64_t seed, int presses, int tests) {
  table::Trial trial =
      table::draw(seed, {.calibration_presses = presses > 1 ? presses : 0, .test_presses = tests});
  const auto limit = [&](table::BallPress& press) {
    press.depth_mm = std::min(press.depth_mm, kMost * specimen.scene.layer.thickness_mm);
  };
  limit(trial.centre);
  std::ranges::for_each(trial.many, limit);
  std::ranges::for_each(trial.tests, limit);
  const table::Configuration& light = table::configurations()[0];
  table::Sensor sensor(table::solve(specimen.scene, trial.all()), light, seed);
  const table::Material material = table::gather(sensor, trial, light.regression_centre);

  calibration::BallPresses set;
  set.reference_q8 = material.reference_q8;
  set.ball_radius_mm = 4;
  set.mm_per_px = table::kMmPerPx;
  set.crop = calibration::Crop{table::kCropCol, table::kCropRow, table::kCrop, table::kCrop};
  if (presses == 1) set.presses.push_back({"centre", material.centre, {}});
  for (std::size_t i = 0; i < material.many.size(); ++i) {
    set.presses.push_back({std::to_string(i), material.many[i], {}});
  }
  Result result;
  result.true_depth_mm = trial.centre.depth_mm;
  std::unique_ptr<Reader> by_model;
  const auto begin = std::chrono::steady_clock::now();
  std::shared_ptr<const recon::Model> model;
  try {
    const calibration::FittedCalibration made = calibration::build_model(set);
    model = made.calibration.model;
    result.fit = made.fit;
    result.light_levels = made.light_levels;
    by_model = std::make_unique<Reader>(model);
  } catch (const calibration::ModelRefused& e) {
    result.refused = e.what();
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::unique_ptr<Reader> by_free;
  try {
    by_free = std::make_unique<Reader>(presses == 1 ? table::ours_single(material)
                                                    : table::ours_many(material));
  } catch (const std::runtime_error&) {
    by_free.reset();  // a chain of presses asks for a light one; result.free_mm stays NaN
  }
  std::array<table::Error, 2> sharpened;
  double depth = 0;
  for (std::size_t i = 0; i < trial.tests.size(); ++i) {
    const std::size_t press = 1 + trial.many.size() + i;
    const image::Grey8 frame = sensor.press(press, 1).front();
    const table::TruePress truth =
        table::true_press(sensor.truth(), table::first_still_frame(sensor.truth(), press));
    if (by_model) {
      by_model->read(frame, truth);
      read_sharpened(*model, frame, truth, sharpened);
    }
    if (by_free) by_free->read(frame, truth);
    depth += trial.tests[i].depth_mm / static_cast<double>(trial.tests.size());
  }
  if (by_free) result.free_mm = by_free->mean_mm();
  if (by_model) {
    result.model_mm = by_model->mean_mm();
    for (std::size_t i = 0; i < sharpened.size(); ++i) {
      result.sharpened_mm[i] = sharpened[i].mean_mm();
    }
    result.bias_mm = by_model->bias_mm();
    result.stated_mm = stated_mm(*model, 0.5 * depth);
  }
  return result;
}

}  // namespace dtact::model_study
