// The model's fit of a real ball press, beside the free LUT: the gel, and the causes of the
// distance from the sphere. With --simulated the same on simulated sensors, where the
// truth is known too.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "clients/calibrate/fit/model/model_lut.hpp"
#include "clients/calibrate/fit/model/radial_transform.hpp"
#include "tests/accuracy/model/study.hpp"
#include "tests/accuracy/real/folder_evaluation.hpp"
#include "tests/accuracy/table/methods.hpp"
#include "tests/accuracy/table/sensor.hpp"

namespace {

using namespace dtact;
using calibration::SymmetricPress;
using DepthOf = std::function<double(double level)>;

/// Mean distance from the sphere over a contact, without the median: of all of it, of its mean on
/// rings, and of the rest on each ring.
struct Distance {
  double all = 0;
  double along = 0;
  double round = 0;
};

double mean_distance(std::vector<double> errors) {
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::ranges::nth_element(errors, middle);
  const double median = *middle;
  double sum = 0;
  for (const double e : errors) sum += std::abs(e - median);
  return sum / static_cast<double>(errors.size());
}

Distance from_sphere(const SymmetricPress& press, const DepthOf& depth_of,
                     const calibration::PixelFilter& leave_out = {}) {
  constexpr double kRings = 60;
  struct Ring {
    double sum = 0;
    double count = 0;
  };
  const calibration::Contact& contact = press.contact;
  std::vector<Ring> rings(static_cast<std::size_t>(kRings));
  std::vector<double> errors;
  std::vector<std::size_t> places;
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double r = calibration::distance_mm(press.map, contact, x, y);
      const double level = press.map.at(x, y);
      if (r >= contact.radius_mm || std::isnan(level) || (leave_out && leave_out(x, y))) continue;
      errors.push_back(depth_of(level) + calibration::sag_mm(contact.ball_radius_mm, r));
      places.push_back(static_cast<std::size_t>(kRings * r / contact.radius_mm));
      rings[places.back()].sum += errors.back();
      rings[places.back()].count += 1;
    }
  }
  std::vector<double> along;
  std::vector<double> round;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    along.push_back(rings[places[i]].sum / rings[places[i]].count);
    round.push_back(errors[i] - along.back());
  }
  return {mean_distance(errors), mean_distance(along), mean_distance(round)};
}

/// The fitted press's own indentation at this darkening: no LUT could do better.
DepthOf own_press(const calibration::ModelFit& fit, double ball_radius_mm,
                  const calibration::MapOptics& optics) {
  using calibration::RadialTransform;
  const calibration::BallContact contact = calibration::press_ball(
      ball_radius_mm, fit.presses[0].contact_radius_mm, fit.gel.thickness_mm);
  const Eigen::VectorXd levels =
      optics.light_levels *
      RadialTransform::instance().values(
          calibration::predict_press(fit.gel, contact)
              .spectrum.cwiseProduct(calibration::scattered(fit.gel.scattering))
              .cwiseProduct(calibration::blurred(optics.smoothing_mm)));
  const double offset = fit.presses[0].offset * optics.light_levels;
  return [=](double level) {
    Eigen::Index i = 0;  // the first place that is no darker
    while (i + 1 < levels.size() && levels[i] > level - offset) ++i;
    if (i == 0) return contact.depth_mm;
    const double part = (levels[i - 1] - level + offset) / (levels[i - 1] - levels[i]);
    return contact.indentation_mm(RadialTransform::kStepMm * (static_cast<double>(i) - 1 + part));
  };
}

void print(const char* what, const Distance& d, double half) {
  fmt::print("    {:18} {:.4f} along the radius {:.4f}, round it {:.4f}; half-disc {:.4f}\n", what,
             d.all, d.along, d.round, half);
}

std::array<calibration::PixelFilter, 4> halves_of(const calibration::Contact& contact) {
  std::array<calibration::PixelFilter, 4> halves;
  for (std::size_t i = 0; i < halves.size(); ++i) {
    const double angle = static_cast<double>(i) * std::numbers::pi / 2;
    halves[i] = [=](int x, int y) {
      return (x - contact.col) * std::cos(angle) + (y - contact.row) * std::sin(angle) > 0;
    };
  }
  return halves;
}

void look(const SymmetricPress& press, const calibration::MapOptics& optics) {
  const double light = optics.light_levels;
  const auto by = [](recon::DepthLut lut) -> DepthOf {
    return [lut = std::move(lut)](double level) { return calibration::lut_mm(lut, level); };
  };
  const auto profile = [&](const calibration::PixelFilter& use) {
    return calibration::profile_of(press, light, optics.smoothing_mm, use);
  };
  const calibration::ModelFit fit = calibration::fit_model(std::vector{profile({})});
  fmt::print(
      "    residual {:.3f} levels, {:.3f} mm deep in {:.2f} ± {:.2f}, {:+.2f} levels darker, "
      "widths "
      "{:.2f} {:.2f} weight {:.2f}\n",
      fit.residual * light, fit.deepest_mm(), fit.gel.thickness_mm,
      fit.gel.thickness_mm * std::sqrt(fit.covariance(0, 0)), fit.presses[0].offset * light,
      fit.gel.scattering.narrow_mm, fit.gel.scattering.wide_mm, fit.gel.scattering.narrow_weight);
  const double ball = press.contact.ball_radius_mm;
  const auto model = [&](const calibration::ModelFit& made) {
    return by(calibration::luts_of(made.gel, optics, made.deepest_mm())[0]);
  };
  const auto own = [&](const calibration::ModelFit& made) { return own_press(made, ball, optics); };
  double free_half = 0;
  double model_half = 0;
  double own_half = 0;
  for (const calibration::PixelFilter& half : halves_of(press.contact)) {
    const auto made = calibration::fit_model(std::vector{profile(half)});
    free_half +=
        from_sphere(press, by(calibration::fit_lut(press.map, press.contact, half)), half).all / 4;
    model_half += from_sphere(press, model(made), half).all / 4;
    own_half += from_sphere(press, own(made), half).all / 4;
  }
  print("free LUT", from_sphere(press, by(calibration::fit_lut(press.map, press.contact))),
        free_half);
  print("model's LUT", from_sphere(press, model(fit)), model_half);
  print("model's own press", from_sphere(press, own(fit)), own_half);
  fmt::print("    depth of the press by parts of its picture: within {:.3f}\n",
             calibration::depth_spread_mm(press, optics, fit));
}

/// Evaluates the press as it is, and about its middle without its gain.
void look(const recon::Model& model, const image::Grey16& reference_q8,
          const std::vector<image::Grey8>& frames) {
  const auto press = calibration::settle(model, reference_q8.pixels, frames, 4.0);
  double light = 0;
  const auto reference = calibration::rectified_reference(model.rectify, reference_q8);
  for (const std::uint8_t level : reference.pixels) light += level;
  light /= static_cast<double>(reference.pixels.size());
  const calibration::MapOptics optics{light, model.smoothing_px * model.mm_per_px, model.mm_per_px};
  const auto chosen =
      calibration::choose_asymmetry(calibration::sure_samples(press.map, press.contact), 4.0);
  for (const bool level : {false, true}) {
    fmt::print("  {}\n", level ? "about its middle, its gain taken off" : "about the centroid");
    try {
      look(calibration::without_asymmetry(press.map, press.contact,
                                          level ? chosen.gain : calibration::PressAsymmetry{}),
           optics);
    } catch (const std::exception& error) {
      fmt::print("    {}\n", error.what());
    }
  }
}

void look(const std::string& folder) {
  const ctl::FolderEvaluation e = ctl::evaluate_folder(folder, {}, 4.0);
  fmt::print("{}{}\n", folder, e.ball ? "" : ": " + e.no_ball);
  if (!e.ball) return;
  for (const bool uniform : {true, false}) {
    for (const bool pins : {true, false}) {
      recon::Model model = *e.calibration->model;
      if (!pins) model.gain = {};
      model.gain.shape = uniform ? recon::GainShape::uniform : recon::GainShape::none;
      fmt::print(" {} light, {} pins' gain\n", uniform ? "uniform" : "plain", pins ? "the" : "no");
      look(model, e.ball_reference.mean_q8(), e.ball_images.frames());
    }
  }
}

/// Evaluates a press at rest near the centre of a simulated sensor, and the LUTs on other balls.
void look(const model_study::Specimen& specimen, std::uint64_t seed) {
  const model_study::Result result = model_study::measure(specimen, seed, 1, 6);
  fmt::print(
      "{}: a ball of 5 mm is read {:.4f} mm wrong by the free LUT, {:.4f} by the model's{}\n",
      specimen.name, result.free_mm, result.model_mm, result.refused);
  const table::Trial trial = table::draw(seed, {.calibration_presses = 0, .test_presses = 0});
  const table::Configuration& light = table::configurations()[0];
  table::Sensor sensor(table::solve(specimen.scene, trial.all()), light, seed);
  const table::Material material = table::gather(sensor, trial, light.regression_centre);
  recon::Model model =
      *calibration::empty_calibration(
           material.reference_q8,
           calibration::Crop{table::kCropCol, table::kCropRow, table::kCrop, table::kCrop},
           table::kMmPerPx, {})
           .model;
  model.gain.shape = recon::GainShape::uniform;
  look(model, material.reference_q8, material.centre);
}

/// Gels of 2 mm and 3 mm, another law, and the sensors fitted to the real ones.
std::vector<model_study::Specimen> simulated() {
  const std::vector<model_study::Specimen> all = model_study::specimens();
  std::vector<model_study::Specimen> some = {all[1], all[3], all.back()};
  for (const char* name : {"sensor_a", "sensor_b"}) {
    const hal::sim::Scene like =
        hal::sim::load_scene(std::string(DTACT_SOURCE_DIR "/tests/accuracy/sim/") + name + ".toml");
    hal::sim::Scene scene = hal::sim::default_scene();
    scene.gel = like.gel;
    scene.optics = like.optics;
    some.push_back({std::string("simulated ") + name, std::move(scene)});
  }
  return some;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The model on real ball presses");
  std::vector<std::string> folders;
  std::uint64_t seed = 0;
  app.add_option("FOLDER", folders);
  app.add_option("--simulated", seed, "Simulated sensors with this seed as well");
  CLI11_PARSE(app, argc, argv);
  for (const std::string& folder : folders) look(folder);
  if (seed == 0) return 0;
  for (const model_study::Specimen& specimen : simulated()) look(specimen, seed);
  return 0;
}
