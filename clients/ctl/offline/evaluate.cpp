#include "daemon/calibration/evaluate.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <stdexcept>

#include "clients/ctl/offline/folder_evaluation.hpp"
#include "clients/ctl/offline/images.hpp"
#include "clients/ctl/offline/offline.hpp"

namespace dtact::ctl {
namespace {

struct Options {
  std::string calibration;
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  double radius_mm = 0;
  bool json = false;
  std::string folder;
  Board board;
  std::string page;
};

void print_json(const calibration::Evaluation& e) {
  const auto number = [](std::optional<double> value) {
    return value ? fmt::format("{:.4f}", *value) : std::string("null");
  };
  fmt::print(
      "{{\"centre_row\": {:.2f}, \"centre_col\": {:.2f}, \"contact_radius_mm\": {:.3f}, "
      "\"peak_levels\": {:.2f}, \"drift_levels\": {:.2f}, \"offset_mm\": {:.4f}, "
      "\"mae_mm\": {:.4f}, \"mae_with_offset_mm\": {:.4f}, \"half_mae_mm\": {}, "
      "\"half_worst_mm\": {}, \"contact_pixels\": {}, \"untrusted_pixels\": {}}}\n",
      e.contact.row, e.contact.col, e.contact.radius_mm, e.contact.peak_levels, e.drift_levels,
      e.offset_mm, e.mae_mm, e.raw_mae_mm, number(e.half_mae_mm), number(e.half_worst_mm), e.pixels,
      e.untrusted);
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

void run_folder(const Options& options) {
  constexpr double kUsualRadius = 4.0;  // mm, of the ball that this kind of sensor comes with
  std::filesystem::path folder = std::filesystem::weakly_canonical(options.folder);
  const FolderEvaluation e = evaluate_folder(
      folder, options.board, options.radius_mm > 0 ? options.radius_mm : kUsualRadius);
  for (const std::string& line : lines_of(e)) fmt::print("{}\n", line);
  if (options.page.empty()) return;
  write_page(e, folder.filename().string(), options.page);
  fmt::print("page: {}\n", (std::filesystem::path(options.page) / "index.html").string());
}

void run(const Options& options) {
  if (!options.folder.empty()) return run_folder(options);
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
  options.json ? print_json(evaluation) : print_text(evaluation);
}

}  // namespace

void add_evaluate(CLI::App& app) {
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
  evaluate->add_flag("--json", options->json, "One JSON object instead of sentences");
  evaluate->callback([options] { run(*options); });
}

}  // namespace dtact::ctl
