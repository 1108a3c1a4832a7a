// What the model makes of a real ball press, beside the free list: residual, layer, half-disc
// error, the press's own gain taken off.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <exception>
#include <numbers>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/model/model_list.hpp"
#include "clients/calibrate/fit/press_gain.hpp"
#include "clients/calibrate/offline/folder_evaluation.hpp"

namespace {

using namespace dtact;

double look_up_mm(const recon::DepthList& list, double level) {
  const long entry = std::lround(level * recon::kEntriesPerLevel) - list.first_q6;
  const long last = static_cast<long>(list.um.size()) - 1;
  return 0.001 * list.um[static_cast<std::size_t>(std::clamp(entry, 0L, last))];
}

/// Mean distance from the sphere over the pixels that `use` leaves out, the median taken off.
double left_out_mm(const calibration::LevelledPress& press, const recon::DepthList& list,
                   const calibration::PixelFilter& use) {
  const calibration::Contact& contact = press.contact;
  std::vector<double> errors;
  for (int y = 0; y < press.map.height; ++y) {
    for (int x = 0; x < press.map.width; ++x) {
      const double r = calibration::distance_mm(press.map, contact, x, y);
      const double level = press.map.at(x, y);
      if (r >= contact.radius_mm || std::isnan(level) || use(x, y)) continue;
      errors.push_back(look_up_mm(list, level) -
                       std::sqrt(std::pow(contact.ball_radius_mm, 2) - r * r));
    }
  }
  std::ranges::nth_element(errors, errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2));
  const double middle = errors[errors.size() / 2];
  double sum = 0;
  for (const double e : errors) sum += std::abs(e - middle);
  return sum / static_cast<double>(errors.size());
}

void look(const std::string& folder) {
  const ctl::FolderEvaluation e = ctl::evaluate_folder(folder, {}, 4.0);
  if (!e.ball) {
    fmt::print("{}: {}\n", folder, e.no_ball);
    return;
  }
  fmt::print("{}: free list, half-disc {:.4f} (worst {:.4f})\n", folder, *e.ball->half_mae_mm,
             *e.ball->half_worst_mm);
  for (const bool uniform : {true, false}) {
    for (const bool pins : {true, false}) {
      recon::Model model = *e.calibration->model;
      if (!pins) model.gain = {};
      model.gain.shape = uniform ? recon::GainShape::uniform : recon::GainShape::none;
      const auto frames = e.ball_images.frames();
      const auto settled =
          calibration::settle(model, e.ball_reference.mean_q8().pixels, frames, 4.0);
      const auto chosen = calibration::choose_press_gain(
          calibration::sure_samples(settled.map, settled.contact), 4.0);
      const calibration::LevelledPress press =
          calibration::levelled(settled.map, settled.contact, chosen.gain);
      double light = 0;
      const auto reference =
          calibration::rectified_reference(model.rectify, e.ball_reference.mean_q8());
      for (const std::uint8_t level : reference.pixels) light += level;
      light /= static_cast<double>(reference.pixels.size());
      const double smoothing = model.smoothing_px * model.mm_per_px;
      const calibration::MapOptics optics{light, smoothing, model.mm_per_px};
      try {
        const auto fit =
            calibration::fit_model(std::vector{calibration::profile_of(press, light, smoothing)});
        fmt::print(
            "  {} light, {} pins' gain: residual {:.3f} levels, {:.3f} deep in {:.2f} ± {:.2f}, "
            "widths {:.2f} "
            "{:.2f} weight {:.2f}, slopes",
            uniform ? "uniform" : "plain", pins ? "the" : "no", fit.residual * light,
            fit.deepest_mm(), fit.layer.thickness_mm,
            fit.layer.thickness_mm * std::sqrt(fit.covariance(0, 0)),
            fit.layer.scattering.narrow_mm, fit.layer.scattering.wide_mm,
            fit.layer.scattering.narrow_weight);
        for (const double s : fit.layer.response.slopes)
          fmt::print(" {:.3f}", s / fit.layer.thickness_mm);
        double model_sum = 0;
        double free_sum = 0;
        for (int i = 0; i < 4; ++i) {
          const double angle = i * std::numbers::pi / 2;
          const calibration::PixelFilter use = [&](int x, int y) {
            return (x - press.contact.col) * std::cos(angle) +
                       (y - press.contact.row) * std::sin(angle) >
                   0;
          };
          const auto half = calibration::fit_model(
              std::vector{calibration::profile_of(press, light, smoothing, use)});
          model_sum += left_out_mm(
              press, calibration::lists_of(half.layer, optics, half.deepest_mm())[0], use);
          free_sum += left_out_mm(press, calibration::fit_list(press.map, press.contact, use), use);
        }
        fmt::print("; half-disc {:.4f}, free {:.4f}\n", model_sum / 4, free_sum / 4);
      } catch (const std::exception& error) {
        fmt::print("  {}\n", error.what());
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The model on real ball presses");
  std::vector<std::string> folders;
  app.add_option("FOLDER", folders)->required();
  CLI11_PARSE(app, argc, argv);
  for (const std::string& folder : folders) look(folder);
  return 0;
}
