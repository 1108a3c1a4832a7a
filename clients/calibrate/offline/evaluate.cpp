#include "clients/calibrate/fit/evaluate.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/plausibility.hpp"
#include "clients/calibrate/offline/folder_evaluation.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"

namespace dtact::ctl {
namespace {

struct EvaluationOptions {
  std::string calibration;
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  double radius_mm = 0;
  std::string folder;
  Board board;
  std::string page;
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
  const auto& gain = e.press_gain.gain;
  for (std::size_t i = 0; i < 2 * static_cast<std::size_t>(gain.order); ++i) {
    report.add_press_gain(gain.factors[i]);
  }
  for (const std::string& doubt : calibration::doubts_about(e)) report.add_doubts(doubt);
  return report;
}

cli::LensReport report_of(const PinPress& pins) {
  cli::LensReport report;
  report.set_pins(pins.marks.size());
  for (const std::string& missing : pins.missing) report.add_missing(missing);
  report.set_rows(pins.rows);
  report.set_cols(pins.cols);
  report.set_rms_mm(rms(pins.lens.in_sample));
  report.set_left_out_rms_mm(rms(pins.lens.left_out));
  report.set_parameters(parameters(pins.lens.model));
  report.set_mm_per_px(recon::central_mm_per_px(pins.lens.lens));
  return report;
}

cli::PinDepthsReport report_of(const PinDepths& depths) {
  cli::PinDepthsReport report;
  report.set_pins(depths.mm.size());
  report.set_mean_mm(depths.mean_mm);
  report.set_spread(depths.spread);
  report.set_tilt_x_um_per_mm(depths.tilt_x_um_per_mm);
  report.set_tilt_y_um_per_mm(depths.tilt_y_um_per_mm);
  return report;
}

cli::FolderReport report_of(const FolderEvaluation& e) {
  cli::FolderReport report;
  report.set_lens_skipped(e.no_pins);
  if (e.pins) *report.mutable_lens() = report_of(*e.pins);
  report.set_ball_skipped(e.no_ball);
  if (e.ball && e.calibration) {  // which made it
    *report.mutable_ball() = report_of(*e.ball);
    for (const std::string& doubt : calibration::doubts_about(e.calibration->model->list)) {
      report.mutable_ball()->add_doubts(doubt);
    }
  }
  report.set_pin_depths_skipped(e.no_pin_depths);
  if (e.pin_depths) *report.mutable_pin_depths() = report_of(*e.pin_depths);
  return report;
}

void print_json(const google::protobuf::Message& report) {
  fmt::print("{}", cli::json_line(report));
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
        "list from one half of the disc, error on the other: {:.4f} mm, at worst {:.4f} mm "
        "of eight halves\n",
        *e.half_mae_mm, e.half_worst_mm.value_or(0));
    fmt::print("list from every other sector of the disc, error on the rest: {:.4f} mm\n",
               e.sector_mae_mm.value_or(0));
    fmt::print("{}\n", e.press_gain.describe());
  }
  fmt::print("untrusted: {} of {} pixels in the contact ({:.2f} %)\n", e.untrusted, e.pixels,
             100.0 * static_cast<double>(e.untrusted) / static_cast<double>(e.pixels));
  for (const std::string& doubt : calibration::doubts_about(e)) fmt::print("doubtful: {}\n", doubt);
}

void run_folder(const EvaluationOptions& options, bool json) {
  constexpr double kUsualRadius = 4.0;  // mm, of the ball that this kind of sensor comes with
  const std::filesystem::path folder = std::filesystem::weakly_canonical(options.folder);
  const FolderEvaluation e = evaluate_folder(
      folder, options.board, options.radius_mm > 0 ? options.radius_mm : kUsualRadius);
  if (!options.page.empty()) write_page(e, folder.filename().string(), options.page);
  if (json) return print_json(report_of(e));
  for (const std::string& line : lines_of(e)) fmt::print("{}\n", line);
  if (options.page.empty()) return;
  fmt::print("page: {}\n", (std::filesystem::path(options.page) / "index.html").string());
}

void run(const EvaluationOptions& options, bool json) {
  if (!options.folder.empty()) return run_folder(options, json);
  if (options.calibration.empty() || options.reference.empty() || options.ball.empty() ||
      options.radius_mm == 0) {
    throw std::runtime_error(
        "give --folder, or --calibration, --reference, --ball and --radius-mm");
  }
  const calibration::Calibration calibration = calibration::load(options.calibration);
  const ImageSet reference = load_images(options.reference, "--reference");
  const ImageSet ball = load_images(options.ball, "--ball");
  require_same_size(reference, "--reference", ball, "--ball");
  const calibration::Evaluation evaluation = calibration::evaluate(
      calibration, reference.mean_q8().pixels, ball.frames(), options.radius_mm);
  json ? print_json(report_of(evaluation)) : print_text(evaluation);
}

}  // namespace

void add_evaluate(CLI::App& app, const bool& json) {
  CLI::App* evaluate =
      app.add_subcommand("evaluate", "Compare a calibration with the press of a ball");
  const auto options = std::make_shared<EvaluationOptions>();
  evaluate->add_option("--calibration", options->calibration, "Calibration folder")
      ->type_name("FOLDER");
  evaluate
      ->add_option("--reference", options->reference,
                   "Untouched surface: PNG files, or a folder of them (averaged)")
      ->type_name("FILE");
  evaluate
      ->add_option("--ball", options->ball,
                   "The ball pressed in: PNG files, or a folder of them (averaged)")
      ->type_name("FILE");
  evaluate
      ->add_option("--radius-mm", options->radius_mm, "Radius of the ball, mm (with --folder: 4)")
      ->check(CLI::Range(0.1, 100.0));
  CLI::Option* folder =
      evaluate
          ->add_option("--folder", options->folder,
                       "Folder with board_reference.png, board.png, ball_reference.png, ball.png: "
                       "measures the lens and makes and judges a calibration through it")
          ->type_name("FOLDER")
          ->excludes("--calibration")
          ->excludes("--reference")
          ->excludes("--ball");
  evaluate->add_option("--pin-rows", options->board.rows, "Rows of the board's pins")
      ->capture_default_str()
      ->check(CLI::Range(2, 100))
      ->needs(folder);
  evaluate->add_option("--pin-cols", options->board.cols, "Columns of the board's pins")
      ->capture_default_str()
      ->check(CLI::Range(2, 100))
      ->needs(folder);
  evaluate->add_option("--pitch-mm", options->board.pitch_mm, "Distance of neighbouring pins, mm")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 100.0))
      ->needs(folder);
  evaluate->add_option("-o,--output", options->page, "Folder for a page of pictures")
      ->type_name("FOLDER")
      ->needs(folder);
  evaluate->callback([options, &json] { run(*options, json); });
}

}  // namespace dtact::ctl
