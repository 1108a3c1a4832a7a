#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/fit/published.hpp"
#include "clients/calibrate/lens/pin_gain.hpp"
#include "clients/calibrate/lens/pin_shift.hpp"
#include "clients/calibrate/lens/pins.hpp"
#include "clients/calibrate/offline/depth_build.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/import_folder.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/program.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

struct ImportOptions {
  std::string folder;
  std::string config;
  std::string pins;
  double pitch_mm = 0;
  double radius_mm = 0;
  double camera_mm = 0;
  std::string output = "cal";
  bool force = false;
};

/// What `make` returns; what it throws names the files that it was about, and ends with `hint`.
template <typename Make>
auto about(const std::string& files, const Make& make, const std::string& hint = {}) {
  try {
    return make();
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("{}: {}{}", files, e.what(), hint));
  }
}

std::string both(const fs::path& reference, const fs::path& pressed) {
  return fmt::format("{} and {}", reference.string(), pressed.filename().string());
}

/// From the folder's shape_config.yaml, or the one that was named; the command line comes first.
ImportSettings settings_of(const ImportOptions& options) {
  ImportSettings settings;
  const fs::path beside = fs::path(options.folder) / "shape_config.yaml";
  if (!options.config.empty()) {
    read_shape_config(options.config, settings);
  } else if (fs::exists(beside)) {
    read_shape_config(beside, settings);
  }
  const auto overrule = [](Stated& stated, double value, const char* option) {
    if (stated.by != "usual" && stated.value != value) {
      fmt::print("{}: {:g} is used, though {} says {:g}\n", option, value, stated.by, stated.value);
    }
    stated = {value, option};
  };
  if (!options.pins.empty()) {
    const auto [rows, cols] = pair_of(options.pins, "--pins");
    overrule(settings.rows, rows, "--pins");
    overrule(settings.cols, cols, "--pins");
  }
  if (options.pitch_mm > 0) overrule(settings.pitch_mm, options.pitch_mm, "--pitch-mm");
  if (options.radius_mm > 0) overrule(settings.radius_mm, options.radius_mm, "--radius-mm");
  return settings;
}

struct Pictures {
  ImageSet board_reference;
  ImageSet board;
  ImageSet ball_reference;
  ImageSet ball;
};

/// All of one size, which is the configuration's where that says one.
Pictures load(const ImportPictures& files, const ImportSettings& settings) {
  const auto picture = [](const fs::path& file) {
    return load_images({file.string()}, file.string());
  };
  Pictures pictures{picture(files.board_reference), picture(files.board),
                    picture(files.ball_reference), picture(files.ball)};
  const std::string first = files.board_reference.string();
  require_same_size(pictures.board, files.board.string(), pictures.board_reference, first);
  require_same_size(pictures.ball_reference, files.ball_reference.string(),
                    pictures.board_reference, first);
  require_same_size(pictures.ball, files.ball.string(), pictures.board_reference, first);
  const int width = pictures.ball.width();
  const int height = pictures.ball.height();
  if (settings.width && settings.height &&
      (settings.width->value != width || settings.height->value != height)) {
    throw std::runtime_error(fmt::format(
        "{} is {}x{} but {} says {:g}x{:g}: take the pictures as the camera gives them, not "
        "rectified or cropped ones, or correct the resolution",
        first, width, height, settings.width->by, settings.width->value, settings.height->value));
  }
  return pictures;
}

PressImages press_of(const Pictures& pictures, const BoardLens& board, double radius_mm,
                     double camera_mm) {
  const recon::Lens& lens = board.pins.lens.lens;
  PressImages images{.set = {.reference_q8 = pictures.ball_reference.mean_q8(),
                             .presses = {{.name = "the ball",
                                          .frames = pictures.ball.frames(),
                                          .depth_mm = std::nullopt}},
                             .ball_radius_mm = radius_mm,
                             .mm_per_px = recon::central_mm_per_px(lens),
                             .crop = {},
                             .lens = lens,
                             .view = view_of(board.shift, camera_mm),
                             .gain_specified = true},
                     .gain = board.gain.gain,
                     .origin = {}};
  images.origin.scale_from = "the lens";
  for (const ImageSet* set :
       {&pictures.board_reference, &pictures.board, &pictures.ball_reference, &pictures.ball}) {
    images.origin.sources.insert(images.origin.sources.end(), set->sources.begin(),
                                 set->sources.end());
  }
  return images;
}

/// Throws where something brightened by more than anything darkened. A ball darkens, and the bulge
/// about it brightens by less than half of that.
void refuse_exchanged(const PressImages& images) {
  const calibration::BallPresses& set = images.set;
  const calibration::Calibration plain =
      calibration::empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
  std::vector<float> levels = calibration::smoothed_darkening(*plain.model, set.reference_q8.pixels,
                                                              set.presses.front().frames)
                                  .levels;
  std::erase_if(levels, [](float level) { return std::isnan(level); });
  if (levels.empty()) return;
  std::ranges::sort(levels);
  const float middle = levels[levels.size() / 2];  // the light may have changed between the two
  constexpr float kSeen = 8;                       // levels: less is no press either
  const float brighter = middle - levels.front();
  if (brighter < kSeen || levels.back() - middle >= brighter) return;
  throw std::runtime_error(
      "the ball's surface became brighter by more than anywhere darker: the undeformed picture and "
      "the pressed one are exchanged, or no ball was pressed");
}

/// What the authors' LUT reads on the same press: the folder's own table, else one made as theirs.
struct Published {
  std::string name;
  std::optional<calibration::Evaluation> ball;
  std::string why_not;
};

Published read_published(const ImportPictures& files, const PressImages& images) {
  const calibration::BallPresses& set = images.set;
  const bool table = fs::exists(files.depth_table);
  Published published{
      table ? "published LUT, Pixel_to_Depth.npy" : "published LUT, made from the same press",
      {},
      {}};
  try {
    const std::vector<image::Grey8>& frames = set.presses.front().frames;
    calibration::Calibration made = calibration::empty_calibration(
        set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
    auto model = std::make_shared<recon::Model>(*made.model);
    model->method = recon::Method::published;
    model->lut = table ? calibration::published_lut(read_depth_table(files.depth_table))
                       : calibration::fit_published(
                             calibration::rectified_reference(model->rectify, set.reference_q8),
                             calibration::rectified_mean(model->rectify, frames),
                             set.ball_radius_mm, set.mm_per_px);
    made.model = std::move(model);
    published.ball =
        calibration::read_ball(made, set.reference_q8.pixels, frames, set.ball_radius_mm);
  } catch (const std::exception& e) {
    published.why_not = e.what();
  }
  return published;
}

void print_board(const BoardLens& board, const ImportSettings& settings) {
  const ChosenLens& lens = board.pins.lens;
  fmt::print(
      "board: {} of {} pins found, {:g} mm apart ({}); {:.4f} mm RMS from their places, "
      "{:.4f} mm each left out of the lens that judges it\n",
      board.pins.marks.size(), board.pins.rows * board.pins.cols, settings.pitch_mm.value,
      settings.pitch_mm.by, rms(lens.in_sample), rms(lens.left_out));
  if (!board.pins.missing.empty()) {
    fmt::print("not found: {}\n", fmt::join(board.pins.missing, "; "));
  }
  fmt::print("{}\n{}\n", board.gain.describe(), board.shift.describe());
}

void print_ball(const calibration::Evaluation& ours, const Published& published,
                const ImportSettings& settings) {
  fmt::print(
      "ball: {:g} mm radius ({}), contact {:.2f} mm in radius at column {:.0f}, row {:.0f} of "
      "the map\n",
      settings.radius_mm.value, settings.radius_mm.by, ours.contact.radius_mm, ours.contact.col,
      ours.contact.row);
  const auto row = [](const std::string& name, const calibration::Evaluation& e) {
    fmt::print("  {:<40} {:.4f} mm   {:.4f} mm   {:+.4f} mm\n", name, e.median_mm, e.within_mm,
               e.offset_mm);
  };
  fmt::print("  {:<40} {:<9}   {:<9}   {}\n", "error on its own press", "median", "95 %",
             "offset, taken off before");
  row("this calibration", ours);
  if (published.ball) {
    row(published.name, *published.ball);
  } else {
    fmt::print("  {}: cannot be compared: {}\n", published.name, published.why_not);
  }
  if (ours.sector_mae_mm && ours.half_mae_mm && ours.half_worst_mm) {
    const double depth_mm =
        calibration::sag_mm(ours.contact.ball_radius_mm, ours.contact.radius_mm);
    fmt::print(
        "this calibration, made from a part of the press, on the rest: {:.4f} mm mean over "
        "sectors ({:.1f} % of the sphere's depth), {:.4f} mm over halves (at worst {:.4f} mm)\n",
        *ours.sector_mae_mm, 100 * *ours.sector_mae_mm / depth_mm, *ours.half_mae_mm,
        *ours.half_worst_mm);
  }
}

void print_next(const ImportOptions& options, const ImportSettings& settings,
                const Pictures& pictures) {
  fmt::print(
      "\nLines for /etc/dtactd/dtactd.toml:\n\n"
      "[camera]\nbackend = \"v4l2\"\nwidth = {}\nheight = {}\nfps = {:g}\n\n"
      "[ring]\nbackend = \"null\"  # no computer commands the light\n\n"
      "Then, with the daemon restarted: dtactctl calibration upload {}\n",
      pictures.ball.width(), pictures.ball.height(), settings.fps.value, options.output);
}

void run(const ImportOptions& options) {
  const ImportPictures files = find_pictures(options.folder);
  const ImportSettings settings = settings_of(options);
  const Pictures pictures = load(files, settings);
  const BoardLens board = about(both(files.board_reference, files.board), [&] {
    return measure_board(mean_levels(pictures.board_reference), mean_levels(pictures.board),
                         {static_cast<int>(settings.rows.value),
                          static_cast<int>(settings.cols.value), settings.pitch_mm.value},
                         calibration::kSmoothingMm);
  });
  print_board(board, settings);
  const std::string ball_files = both(files.ball_reference, files.ball);
  const std::string hint = fmt::format(
      "; the radius is {:g} mm ({}), the scale follows from pins {:g} mm apart ({}): give "
      "--radius-mm or --pitch-mm where that is wrong",
      settings.radius_mm.value, settings.radius_mm.by, settings.pitch_mm.value,
      settings.pitch_mm.by);
  calibration::PressReport report;
  const PressImages images = press_of(pictures, board, settings.radius_mm.value, options.camera_mm);
  about(ball_files, [&] { refuse_exchanged(images); });
  const calibration::Calibration made =
      about(ball_files, [&] { return build_lut(images, FitMethod::automatic, &report); }, hint);
  fmt::print("{}", report_text(report));
  const calibration::Evaluation ours = about(
      ball_files,
      [&] {
        return calibration::evaluate(made, images.set.reference_q8.pixels,
                                     images.set.presses.front().frames, images.set.ball_radius_mm);
      },
      hint);
  std::vector<std::string> doubts = calibration::doubts_about(made.model->lut);
  std::ranges::move(calibration::doubts_about(ours), std::back_inserter(doubts));
  print_ball(ours, read_published(files, images), settings);
  about(ball_files, [&] { save_or_refuse(made, doubts, options.force, options.output, hint); });
  const recon::RectifyTable& map = made.model->rectify;
  const double scale = made.model->mm_per_px;
  fmt::print(
      "{}: {}x{} pixels at column {}, row {}, {:.5f} mm each, {:.1f} x {:.1f} mm in all; if "
      "the gel is of another size, give --pitch-mm\n{}",
      options.output, map.width, map.height, made.crop_col, made.crop_row, scale, scale * map.width,
      scale * map.height, lut_text(*made.model));
  print_next(options, settings, pictures);
}

}  // namespace

void add_import(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "import", "Make a calibration from the pictures of a 9DTact or DTact calibration");
  const auto options = std::make_shared<ImportOptions>();
  command
      ->add_option("FOLDER", options->folder,
                   "Folder with camera_calibration/{ref,sample}.png (a board of pins) and "
                   "depth_calibration/{ref,sample}.png (a ball), each undeformed and pressed")
      ->type_name("FOLDER")
      ->required();
  command
      ->add_option("--config", options->config,
                   "shape_config.yaml of the sensor (default: the folder's, where there is one)")
      ->type_name("FILE");
  command
      ->add_option("--pins", options->pins,
                   "Rows and columns of pins (default: the configuration's, or 7x9)")
      ->type_name("RxC");
  command
      ->add_option("--pitch-mm", options->pitch_mm,
                   "Distance of neighbouring pins, mm (default: the configuration's, or 2.5)")
      ->check(cli::in_range(0.1, 100.0));
  command
      ->add_option("--radius-mm", options->radius_mm,
                   "Radius of the ball, mm (default: the configuration's, or 4)")
      ->check(cli::in_range(0.2, 99.0));
  add_camera_option(*command, options->camera_mm, "as the pins show");
  command
      ->add_option("-o,--output", options->output,
                   "Folder to write; an old calibration is replaced")
      ->type_name("FOLDER")
      ->capture_default_str();
  command->add_flag("--force", options->force,
                    "Write the calibration although LUT and ball disagree");
  command->callback([options] { run(*options); });
}

}  // namespace dtact::ctl
