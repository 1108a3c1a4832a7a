#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/offline/depth_build.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/program.hpp"

namespace dtact::ctl {
namespace {

struct DepthOptions {
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  std::vector<std::string> presses;
  double radius_mm = 0;
  MapOptions map;
  std::string method = "auto";
  std::vector<double> gain_centre{0, 0};  ///< x, y in millimetres from the map's centre.
  std::string output;
  bool force = false;
};

/// A calibration and the doubts about it.
struct Made {
  calibration::Calibration calibration;
  std::vector<std::string> doubts;
};

/// With the paper's LUT of one press.
Made make_published(const DepthOptions& options) {
  const ImageSet reference = load_images(options.reference, "--reference");
  const ImageSet ball = load_images(options.ball, "--ball");
  require_same_size(reference, "--reference", ball, "--ball");
  const MapChoice map = choose_map(options.map, reference.width(), reference.height());
  const calibration::BallPress press{.reference_q8 = reference.mean_q8(),
                                     .frames = ball.frames(),
                                     .ball_radius_mm = options.radius_mm,
                                     .mm_per_px = map.mm_per_px,
                                     .lens = map.lens,
                                     .crop = map.crop,
                                     .view = map.view,
                                     .gain = map.gain,
                                     .method = recon::Method::published};
  calibration::Calibration made = calibration::build(press);
  made.origin = recorded_origin(options.reference);
  made.origin.created = utc_now();
  made.origin.scale_from = map.scale_from;
  made.origin.sources = reference.sources;
  made.origin.sources.insert(made.origin.sources.end(), ball.sources.begin(), ball.sources.end());
  std::vector<std::string> doubts = calibration::doubts_about(made, press);
  return {std::move(made), std::move(doubts)};
}

/// With the LUT of one press or several.
Made make_lut(const DepthOptions& options) {
  PressImages images = begin_presses(options.reference, options.radius_mm, options.map);
  if (!options.ball.empty()) add_press(images, options.ball, "--ball");
  for (const std::string& press : options.presses) add_press(images, press);
  const bool measured = std::ranges::any_of(
      images.set.presses, [](const auto& press) { return press.depth_mm.has_value(); });
  if (measured && (options.method == "model" || options.method == "regression")) {
    throw std::runtime_error(fmt::format(
        "--method {} does not use measured depths: leave @MM out, or take --method auto or list",
        options.method));
  }
  if (options.method == "regression") {
    calibration::Calibration made =
        calibration::build_regression(images.set, options.gain_centre[0], options.gain_centre[1]);
    made.origin = images.origin;
    made.origin.created = utc_now();
    std::vector<std::string> doubts = calibration::doubts_about(made, images.set);
    return {std::move(made), std::move(doubts)};
  }
  calibration::PressReport report;
  calibration::Calibration made = build_lut(images, fit_method(options.method), &report);
  fmt::print("{}", report_text(report));
  std::vector<std::string> doubts = calibration::doubts_about(made, images.set);
  return {std::move(made), std::move(doubts)};
}

void check(const DepthOptions& options) {
  const bool many = !options.presses.empty();
  if (many == !options.ball.empty()) {
    throw std::runtime_error("either --ball (one press) or --press for each of several is needed");
  }
  if (many ? options.method == "published" : options.method == "regression") {
    throw std::runtime_error(many ? "--method published takes one press: --ball"
                                  : "--method regression takes several presses: --press");
  }
}

void run(const DepthOptions& options) {
  check(options);
  const auto [made, doubts] =
      options.method == "published" ? make_published(options) : make_lut(options);
  save_or_refuse(made, doubts, options.force, options.output);
  const recon::RectifyTable& map = made.model->rectify;
  fmt::print("{}: method {}, {}x{} at column {}, row {}\n", options.output, options.method,
             map.width, map.height, made.crop_col, made.crop_row);
  if (made.gel) fmt::print("{}", gel_text(*made.gel));
  fmt::print("{}", lut_text(*made.model));
}

}  // namespace

void add_calibrate(CLI::App& app) {
  CLI::App* depth = app.add_subcommand(
      "depth", "Make a calibration from images: the press of a ball, or several presses");
  const auto options = std::make_shared<DepthOptions>();
  depth
      ->add_option(
          "--reference", options->reference,
          "Undeformed surface: PNG files, or a folder of them (averaged); camera and light "
          "are recorded from the folder's sensor.toml where there is one")
      ->type_name("FILE")
      ->required();
  depth
      ->add_option("--ball", options->ball,
                   "One press of the ball: PNG files, or a folder of them (averaged)")
      ->type_name("FILE");
  depth
      ->add_option("--press", options->presses,
                   "One of several presses, at any place and depth, some of them light: a PNG file "
                   "or a folder; repeat. FOLDER@MM where the depth was measured")
      ->type_name("FILE")
      ->take_all();
  depth->add_option("--radius-mm", options->radius_mm, "Radius of the ball, mm")
      ->check(cli::in_range(0.1, 100.0))
      ->required();
  add_map_options(*depth, options->map);
  depth
      ->add_option(
          "--method", options->method,
          "auto (default): a gel is fitted to the whole image of the presses; where it explains "
          "all but noise, its LUT, else what the presses show, at the gel's depths where all "
          "parts of the picture agree on them; model: the gel's LUT in any case; list: from the "
          "known sphere alone; to compare with: published (one press), regression (several)")
      ->check(CLI::IsMember({"auto", "list", "model", "published", "regression"}));
  depth
      ->add_option("--gain-centre", options->gain_centre,
                   "Where the regression's distance is taken from, mm right and down of the middle")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y");
  depth
      ->add_option("-o,--output", options->output,
                   "Folder to write; an old calibration is replaced")
      ->type_name("FOLDER")
      ->required();
  depth->add_flag("--force", options->force,
                  "Write the calibration although LUT and ball disagree: a wrong scale or radius, "
                  "another light, a contact that is cut off");
  depth->callback([options] { run(*options); });
}

}  // namespace dtact::ctl
