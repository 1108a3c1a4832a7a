#include "clients/calibrate/fit/evaluate.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/offline/folder_evaluation.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/ctl/json/json.hpp"

namespace dtact::ctl {
namespace {

struct Options {
  std::string calibration;
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  double radius_mm = 0;
  std::string folder;
  Board board;
  std::string page;
};

void add_optional(Json& json, const char* name, std::optional<double> value) {
  value ? json.member(name, *value) : json.key(name).null();
}

/// The members of a press's evaluation.
void add_press(Json& json, const calibration::Evaluation& e) {
  json.member("centre_row", e.contact.row)
      .member("centre_col", e.contact.col)
      .member("contact_radius_mm", e.contact.radius_mm)
      .member("peak_levels", e.contact.peak_levels)
      .member("drift_levels", e.drift_levels)
      .member("offset_mm", e.offset_mm)
      .member("mae_mm", e.mae_mm)
      .member("mae_with_offset_mm", e.raw_mae_mm);
  add_optional(json, "half_mae_mm", e.half_mae_mm);
  add_optional(json, "half_worst_mm", e.half_worst_mm);
  json.member("contact_pixels", e.pixels).member("untrusted_pixels", e.untrusted);
}

void print_json(const calibration::Evaluation& e) {
  Json json;
  json.open('{');
  add_press(json, e);
  fmt::print("{}\n", json.close('}').text());
}

/// What was skipped is an object with its reason.
void print_json(const FolderEvaluation& e) {
  Json json;
  json.open('{').key("lens").open('{');
  if (e.pins) {
    const ChosenLens& lens = e.pins->lens;
    json.member("pins", e.pins->marks.size())
        .member("missing", e.pins->missing)
        .member("rows", e.pins->rows)
        .member("cols", e.pins->cols)
        .member("rms_mm", rms(lens.in_sample))
        .member("left_out_rms_mm", rms(lens.left_out))
        .member("parameters", parameters(lens.model))
        .member("mm_per_px", recon::central_mm_per_px(lens.lens));
  } else {
    json.member("skipped", e.no_pins);
  }
  json.close('}').key("ball").open('{');
  if (e.ball) {
    add_press(json, *e.ball);
  } else {
    json.member("skipped", e.no_ball);
  }
  json.close('}').key("pin_depths").open('{');
  if (e.pin_depths) {
    json.member("pins", e.pin_depths->mm.size())
        .member("mean_mm", e.pin_depths->mean_mm)
        .member("spread", e.pin_depths->spread)
        .member("tilt_x_um_per_mm", e.pin_depths->tilt_x_um_per_mm)
        .member("tilt_y_um_per_mm", e.pin_depths->tilt_y_um_per_mm);
  } else {
    json.member("skipped", e.no_pin_depths);
  }
  fmt::print("{}\n", json.close('}').close('}').text());
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
  }
  fmt::print("untrusted: {} of {} pixels in the contact ({:.2f} %)\n", e.untrusted, e.pixels,
             100.0 * static_cast<double>(e.untrusted) / static_cast<double>(e.pixels));
}

void run_folder(const Options& options, bool json) {
  constexpr double kUsualRadius = 4.0;  // mm, of the ball that this kind of sensor comes with
  const std::filesystem::path folder = std::filesystem::weakly_canonical(options.folder);
  const FolderEvaluation e = evaluate_folder(
      folder, options.board, options.radius_mm > 0 ? options.radius_mm : kUsualRadius);
  if (!options.page.empty()) write_page(e, folder.filename().string(), options.page);
  if (json) return print_json(e);
  for (const std::string& line : lines_of(e)) fmt::print("{}\n", line);
  if (options.page.empty()) return;
  fmt::print("page: {}\n", (std::filesystem::path(options.page) / "index.html").string());
}

void run(const Options& options, bool json) {
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
  json ? print_json(evaluation) : print_text(evaluation);
}

}  // namespace

void add_evaluate(CLI::App& app, const bool& json) {
  CLI::App* evaluate =
      app.add_subcommand("evaluate", "Compare a calibration with the press of a ball");
  const auto options = std::make_shared<Options>();
  evaluate->add_option("--calibration", options->calibration, "Calibration folder");
  evaluate->add_option("--reference", options->reference,
                       "Untouched surface: PNG files, or a folder of them (averaged)");
  evaluate->add_option("--ball", options->ball,
                       "The ball pressed in: PNG files, or a folder of them (averaged)");
  evaluate
      ->add_option("--radius-mm", options->radius_mm, "Radius of the ball, mm (with --folder: 4)")
      ->check(CLI::Range(0.1, 100.0));
  CLI::Option* folder =
      evaluate
          ->add_option("--folder", options->folder,
                       "Folder with board_reference.png, board.png, ball_reference.png, ball.png: "
                       "measures the lens and makes and judges a calibration through it")
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
      ->needs(folder);
  evaluate->callback([options, &json] { run(*options, json); });
}

}  // namespace dtact::ctl
