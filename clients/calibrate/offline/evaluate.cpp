#include "clients/calibrate/fit/evaluate.hpp"

#include <fmt/format.h>

#include <memory>

#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/json.hpp"
#include "clients/common/program.hpp"
#include "clients/common/reports.pb.h"

namespace dtact::ctl {
namespace {

struct EvaluationOptions {
  std::string calibration;
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  double radius_mm = 0;
};

cli::BallReport report_of(const calibration::Evaluation& e) {
  cli::BallReport report;
  report.set_centre_row(e.contact.row);
  report.set_centre_col(e.contact.col);
  report.set_contact_radius_mm(e.contact.radius_mm);
  report.set_peak_levels(e.contact.peak_levels);
  report.set_drift_levels(e.drift_levels);
  report.set_offset_mm(e.offset_mm);
  report.set_mae_mm(e.mae_mm);
  report.set_mae_with_offset_mm(e.raw_mae_mm);
  if (e.half_mae_mm) report.set_half_mae_mm(*e.half_mae_mm);
  if (e.half_worst_mm) report.set_half_worst_mm(*e.half_worst_mm);
  report.set_contact_pixels(e.pixels);
  report.set_untrusted_pixels(e.untrusted);
  if (e.sector_mae_mm) report.set_sector_mae_mm(*e.sector_mae_mm);
  const auto& gain = e.press_asymmetry.gain;
  for (std::size_t i = 0; i < 2 * static_cast<std::size_t>(gain.order); ++i) {
    report.add_press_asymmetry(gain.factors[i]);
  }
  for (const std::string& doubt : calibration::doubts_about(e)) report.add_doubts(doubt);
  return report;
}

void print_text(const calibration::Evaluation& e) {
  fmt::print(
      "contact: row {:.1f}, column {:.1f} of the depth map, radius {:.2f} mm, {:.1f} grey "
      "levels at most\n",
      e.contact.row, e.contact.col, e.contact.radius_mm, e.contact.peak_levels);
  if (e.drift_levels != 0) {
    fmt::print("drift: {:.1f} grey levels taken off\n", e.drift_levels);
  }
  fmt::print("offset from the sphere that is zero at the contact's edge: {:+.4f} mm\n",
             e.offset_mm);
  fmt::print("mean absolute error: {:.4f} mm, with the offset {:.4f} mm\n", e.mae_mm, e.raw_mae_mm);
  if (e.half_mae_mm) {
    fmt::print(
        "LUT from one half of the disc, error on the other: {:.4f} mm, at worst {:.4f} mm "
        "of eight halves\n",
        *e.half_mae_mm, e.half_worst_mm.value_or(0));
    fmt::print("LUT from every other sector of the disc, error on the rest: {:.4f} mm\n",
               e.sector_mae_mm.value_or(0));
    fmt::print("{}\n", e.press_asymmetry.describe());
  }
  fmt::print("untrusted: {} of {} pixels in the contact ({:.2f} %)\n", e.untrusted, e.pixels,
             100.0 * static_cast<double>(e.untrusted) / static_cast<double>(e.pixels));
  for (const std::string& doubt : calibration::doubts_about(e)) fmt::print("doubtful: {}\n", doubt);
}

void run(const EvaluationOptions& options, bool json) {
  const calibration::Calibration calibration = calibration::load(options.calibration);
  const ImageSet reference = load_images(options.reference, "--reference");
  const ImageSet ball = load_images(options.ball, "--ball");
  require_same_size(reference, "--reference", ball, "--ball");
  const calibration::Evaluation evaluation = calibration::evaluate(
      calibration, reference.mean_q8().pixels, ball.frames(), options.radius_mm);
  if (json) {
    fmt::print("{}", cli::json_line(report_of(evaluation)));
  } else {
    print_text(evaluation);
  }
}

}  // namespace

void add_evaluate(CLI::App& app, const bool& json) {
  CLI::App* evaluate =
      app.add_subcommand("evaluate", "Compare a calibration with the press of a ball");
  const auto options = std::make_shared<EvaluationOptions>();
  evaluate->add_option("--calibration", options->calibration, "Calibration folder")
      ->type_name("FOLDER")
      ->required();
  evaluate
      ->add_option("--reference", options->reference,
                   "Undeformed surface: PNG files, or a folder of them (averaged)")
      ->type_name("FILE")
      ->required();
  evaluate
      ->add_option("--ball", options->ball,
                   "The ball pressed in: PNG files, or a folder of them (averaged)")
      ->type_name("FILE")
      ->required();
  evaluate->add_option("--radius-mm", options->radius_mm, "Radius of the ball, mm")
      ->required()
      ->check(cli::in_range(0.1, 100.0));
  evaluate->callback([options, &json] { run(*options, json); });
}

}  // namespace dtact::ctl
