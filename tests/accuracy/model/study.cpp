#include "tests/accuracy/model/study.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "tests/accuracy/table/another_law.hpp"
#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/methods.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/thickness/thickness.hpp"

namespace dtact::model_study {
namespace {

constexpr double kMax = 0.85;  // of the gel

Specimen with_optics(std::string name, double thickness_mm, const hal::sim::OpticsModel& optics) {
  hal::sim::Scene scene = hal::sim::default_scene();
  scene.gel.thickness_mm = thickness_mm;
  scene.optics = optics;
  return {std::move(name), std::move(scene)};
}

class Reader {
 public:
  explicit Reader(const std::shared_ptr<const recon::Model>& model, int sharpen_steps = 0)
      : reader_(model, sharpen_steps) {}

  void read(const image::Grey8& frame, const table::TruePress& truth) {
    const auto depth = reader_.read(frame);
    error_ += table::against_indentation(depth, truth);
    for (std::size_t i = 0; i < depth.size(); ++i) {
      if (truth.contact[i] == 0 || depth[i] == recon::kUntrusted) continue;
      bias_ += 0.001 * depth[i] - static_cast<double>(truth.indentation_mm[i]);
    }
  }
  [[nodiscard]] double mean_mm() const { return error_.mean_mm(); }
  [[nodiscard]] double bias_mm() const { return bias_ / static_cast<double>(error_.pixels); }

 private:
  calibration::DepthReader reader_;
  table::Error error_;
  double bias_ = 0;
};

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
  // Chosen before any measurement on them: curved and steep, flat and wide, a kink at zero,
  // little narrow light.
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
  all.push_back({"another law", table::another_law()});
  // The gel is the subject, not where its points appear.
  for (Specimen& specimen : all) specimen.scene.surface.camera_mm = 0;
  return all;
}

Result measure(const Specimen& specimen, std::uint64_t seed, int presses, int tests) {
  table::Trial trial =
      table::draw(seed, {.calibration_presses = presses > 1 ? presses : 0, .test_presses = tests});
  const auto limit = [&](table::BallPress& press) {
    press.depth_mm = std::min(press.depth_mm, kMax * specimen.scene.gel.thickness_mm);
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
  set.view = material.view;
  set.crop = calibration::Crop{table::kCropCol, table::kCropRow, table::kCrop, table::kCrop};
  if (presses == 1) set.presses.push_back({"centre", material.centre, {}});
  for (std::size_t i = 0; i < material.many.size(); ++i) {
    set.presses.push_back({std::to_string(i), material.many[i], {}});
  }
  Result result;
  result.true_depth_mm = trial.centre.depth_mm;
  std::vector<Reader> by_model;  // plain, and by one and two steps
  const auto begin = std::chrono::steady_clock::now();
  std::shared_ptr<const recon::Model> model;
  try {
    const calibration::FittedCalibration made = calibration::build_model(set);
    model = made.calibration.model;
    result.fit = made.fit;
    result.light_levels = made.light_levels;
    for (int steps = 0; steps <= 2; ++steps) by_model.emplace_back(model, steps);
  } catch (const calibration::ModelRefused& e) {
    result.refused = e.what();
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  calibration::PressReport report;
  Reader by_ours(calibration::build_auto(set, {}, report).model);
  result.note = report.note;
  std::unique_ptr<Reader> by_free;
  try {
    by_free = std::make_unique<Reader>(presses == 1 ? table::alone_single(material)
                                                    : table::alone_many(material));
  } catch (const std::runtime_error&) {
    by_free.reset();  // a chain of presses needs a light one; result.free_mm stays NaN
  }
  double depth = 0;
  for (std::size_t i = 0; i < trial.tests.size(); ++i) {
    const std::size_t press = 1 + trial.many.size() + i;
    const image::Grey8 frame = sensor.press(press, 1).front();
    const table::TruePress truth =
        table::true_press(sensor.truth(), table::first_still_frame(sensor.truth(), press));
    for (Reader& reader : by_model) reader.read(frame, truth);
    by_ours.read(frame, truth);
    if (by_free) by_free->read(frame, truth);
    depth += trial.tests[i].depth_mm / static_cast<double>(trial.tests.size());
  }
  result.ours_mm = by_ours.mean_mm();
  if (by_free) result.free_mm = by_free->mean_mm();
  if (!by_model.empty()) {
    result.model_mm = by_model[0].mean_mm();
    for (std::size_t i = 0; i < result.sharpened_mm.size(); ++i) {
      result.sharpened_mm[i] = by_model[i + 1].mean_mm();
    }
    result.bias_mm = by_model[0].bias_mm();
    result.stated_mm = stated_mm(*model, 0.5 * depth);
  }
  return result;
}

}  // namespace dtact::model_study
