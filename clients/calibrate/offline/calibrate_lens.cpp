#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/lens/chessboard.hpp"
#include "clients/calibrate/lens/pin_gain.hpp"
#include "clients/calibrate/lens/pin_shift.hpp"
#include "clients/calibrate/lens/pins.hpp"
#include "clients/calibrate/offline/depth_build.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/program.hpp"
#include "daemon/calibration/sensor_files.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

struct LensOptions {
  std::vector<std::string> reference;
  std::vector<std::string> board;
  std::string pins = "7x9";
  double pitch_mm = 2.5;
  std::vector<std::string> chessboard;
  std::string squares;
  double square_mm = 0;
  double camera_mm = 0;
  std::string output;
};

void write(const LensOptions& options, const ImageSet& images, const ChosenLens& chosen,
           const std::optional<recon::FlatFieldGain>& gain, const PinShift& shift,
           const std::vector<std::string>& what) {
  calibration::LensFile file{
      images.width(), images.height(),  chosen.lens, gain.value_or(recon::FlatFieldGain{}),
      what,           gain.has_value(), {}};
  file.view = view_of(shift, options.camera_mm);
  recon::check(file.lens, file.frame_width, file.frame_height);
  file.notes.push_back(
      fmt::format("RMS distance from the ideal places: {:.4f} mm, each left out of "
                  "the lens that judges it {:.4f} mm ({} parameters)",
                  rms(chosen.in_sample), rms(chosen.left_out), parameters(chosen.model)));
  base::write_file_atomically(options.output, calibration::format(file));
  fmt::print("{}: {}\n", options.output, fmt::join(file.notes, "\n"));
  fmt::print("left-out RMS with 6, 8, 11, ... parameters: {:.4f} mm\n",
             fmt::join(chosen.left_out_rms_of_each, ", "));
  fmt::print("centre of the map: {:.5f} mm per pixel\n", recon::central_mm_per_px(file.lens));
}

void run_board(const LensOptions& options) {
  const ImageSet reference = load_images(options.reference, "--board-reference");
  const ImageSet pressed = load_images(options.board, "--board");
  require_same_size(reference, "--board-reference", pressed, "--board");
  const auto [rows, cols] = pair_of(options.pins, "--pins");
  const auto [press, gain, shift] =
      measure_board(mean_levels(reference), mean_levels(pressed), {rows, cols, options.pitch_mm},
                    calibration::kSmoothingMm);
  std::string what =
      fmt::format("{}x{} pins, {} mm apart", press.rows, press.cols, options.pitch_mm);
  if (!press.missing.empty()) {
    what += fmt::format("; not found: {}", fmt::join(press.missing, "; "));
  }
  write(options, reference, press.lens, gain.gain, shift,
        {what, gain.describe(), shift.describe()});
}

void run_chessboard(const LensOptions& options) {
  const ImageSet images = load_images(options.chessboard, "--chessboard");
  const auto [cols, rows] = pair_of(options.squares, "--squares");
  std::vector<std::string> names;
  names.reserve(images.sources.size());
  for (const auto& source : images.sources) names.push_back(source.name);
  const ChessboardLens made =
      calibrate_chessboards(grey_images(images), names, {cols, rows, options.square_mm});
  write(options, images, made.lens, std::nullopt, {.foot_mm = axis_foot(made.lens.lens)},
        {fmt::format("chessboard of {}x{} squares of {} mm, {} image(s)", cols, rows,
                     options.square_mm, images.images.size())});
}

void run(const LensOptions& options) {
  if (!options.chessboard.empty()) {
    run_chessboard(options);
  } else if (!options.board.empty() && !options.reference.empty()) {
    run_board(options);
  } else {
    throw std::runtime_error(
        "give --board-reference and --board, or --chessboard with --squares and --square-mm");
  }
}

}  // namespace

void add_calibrate_lens(CLI::App& app) {
  CLI::App* lens = app.add_subcommand(
      "lens", "Measure where the camera shows the surface, from a board of pins or chessboards");
  const auto options = std::make_shared<LensOptions>();
  CLI::Option* reference =
      lens->add_option("--board-reference", options->reference,
                       "Undeformed surface: PNG files, or a folder of them (averaged)")
          ->type_name("FILE");
  CLI::Option* board = lens->add_option("--board", options->board,
                                        "The board of pins pressed in: PNG files, or a folder")
                           ->type_name("FILE");
  board->needs(reference);
  lens->add_option("--pins", options->pins, "Rows and columns of pins")
      ->capture_default_str()
      ->type_name("RxC");
  lens->add_option("--pitch-mm", options->pitch_mm, "Distance of neighbouring pins, mm")
      ->capture_default_str()
      ->check(cli::in_range(0.1, 100.0));
  CLI::Option* chessboard =
      lens->add_option(
              "--chessboard", options->chessboard,
              "Images of a chessboard: the first lies on the surface, the others are tilted")
          ->type_name("FILE");
  chessboard->excludes(board)
      ->needs(lens->add_option("--squares", options->squares, "Squares across and down")
                  ->type_name("CxR"))
      ->needs(lens->add_option("--square-mm", options->square_mm, "Side of a square, mm")
                  ->check(cli::in_range(0.1, 100.0)));
  add_camera_option(*lens, options->camera_mm, "as the pins show");
  lens->add_option("-o,--output", options->output, "Lens file to write (TOML)")
      ->type_name("FILE")
      ->required();
  lens->callback([options] { run(*options); });
}

}  // namespace dtact::ctl
