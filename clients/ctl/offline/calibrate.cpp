#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <memory>
#include <stdexcept>

#include "clients/ctl/offline/images.hpp"
#include "clients/ctl/offline/offline.hpp"
#include "daemon/calibration/build.hpp"
#include "daemon/calibration/lens_file.hpp"
#include "daemon/calibration/press_set.hpp"

namespace dtact::ctl {
namespace {

struct Options {
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  std::vector<std::string> presses;
  double radius_mm = 0;
  double mm_per_px = 0;  ///< 0: the lens's.
  std::string lens;
  std::vector<int> centre;  ///< Row, column.
  std::vector<int> crop;    ///< Height, width.
  std::string method = "list";
  std::vector<double> gain_centre{0, 0};  ///< x, y in millimetres from the map's centre.
  std::string output;
};

std::optional<calibration::Crop> crop_of(const Options& options, int width, int height) {
  if (options.crop.empty()) {
    if (!options.centre.empty()) throw std::runtime_error("--centre needs --crop HEIGHT,WIDTH");
    return std::nullopt;
  }
  const std::vector<int> centre =
      options.centre.empty() ? std::vector<int>{height / 2, width / 2} : options.centre;
  return calibration::Crop{centre[1] - options.crop[1] / 2, centre[0] - options.crop[0] / 2,
                           options.crop[1], options.crop[0]};
}

recon::Lens lens_for(const std::string& path, const ImageSet& images) {
  const calibration::LensFile file = calibration::load_lens(path);
  if (file.frame_width != images.width() || file.frame_height != images.height()) {
    throw std::runtime_error(fmt::format(
        "--lens: {} was measured on {}x{} but the images are {}x{}; both must come from one camera "
        "mode",
        path, file.frame_width, file.frame_height, images.width(), images.height()));
  }
  return file.lens;
}

/// What says how large a pixel is, and where the camera sees it.
struct Scale {
  std::optional<recon::Lens> lens;
  double mm_per_px = 0;
};

Scale scale_of(const Options& options, const ImageSet& reference) {
  Scale scale{{}, options.mm_per_px};
  if (!options.lens.empty()) {
    scale.lens = lens_for(options.lens, reference);
    if (scale.mm_per_px == 0) scale.mm_per_px = recon::central_mm_per_px(*scale.lens);
  } else if (scale.mm_per_px == 0) {
    throw std::runtime_error("--mm-per-px or --lens is required: one of them says the scale");
  }
  return scale;
}

/// "FOLDER@0.8": the press's images and the depth that was measured.
calibration::BallPresses::Press load_press(const std::string& text, const ImageSet& reference,
                                           calibration::Origin& origin) {
  calibration::BallPresses::Press press{.name = text, .frames = {}, .depth_mm = {}};
  std::string path = text;
  if (const std::size_t at = text.rfind('@'); at != std::string::npos) {
    std::size_t read = 0;
    try {
      press.depth_mm = std::stod(text.substr(at + 1), &read);
    } catch (const std::exception&) {
      read = 0;
    }
    if (read == 0 || read != text.size() - at - 1 || !(*press.depth_mm > 0)) {
      throw std::runtime_error("--press " + text + ": after @ comes a depth in millimetres");
    }
    path = text.substr(0, at);
  }
  const ImageSet images = load_images({path}, "--press");
  require_same_size(reference, "--reference", images, "--press");
  press.frames = images.frames();
  origin.sources.insert(origin.sources.end(), images.sources.begin(), images.sources.end());
  return press;
}

/// From one press.
calibration::Calibration make_from_one(const Options& options, const ImageSet& reference) {
  const ImageSet ball = load_images(options.ball, "--ball");
  require_same_size(reference, "--reference", ball, "--ball");
  const Scale scale = scale_of(options, reference);
  calibration::Calibration made = calibration::build(
      {.reference_q8 = reference.mean_q8(),
       .frames = ball.frames(),
       .ball_radius_mm = options.radius_mm,
       .mm_per_px = scale.mm_per_px,
       .lens = scale.lens,
       .crop = crop_of(options, reference.width(), reference.height()),
       .method = options.method == "published" ? recon::Method::published : recon::Method::list});
  made.origin.sources = reference.sources;
  made.origin.sources.insert(made.origin.sources.end(), ball.sources.begin(), ball.sources.end());
  return made;
}

/// From several.
calibration::Calibration make_from_many(const Options& options, const ImageSet& reference) {
  calibration::Origin origin;
  origin.sources = reference.sources;
  const Scale scale = scale_of(options, reference);
  calibration::BallPresses set{.reference_q8 = reference.mean_q8(),
                               .presses = {},
                               .ball_radius_mm = options.radius_mm,
                               .mm_per_px = scale.mm_per_px,
                               .crop = crop_of(options, reference.width(), reference.height()),
                               .lens = scale.lens};
  for (const std::string& text : options.presses) {
    set.presses.push_back(load_press(text, reference, origin));
  }
  calibration::PressReport report;
  calibration::Calibration made =
      options.method == "regression"
          ? calibration::build_regression(set, options.gain_centre[0], options.gain_centre[1])
          : calibration::build(set, &report);
  made.origin = origin;
  for (const std::string& press : report.left_out) fmt::print("left out: {}\n", press);
  for (const auto& press : report.presses) {
    fmt::print("{}: {:.3f} mm deep\n", press.name, press.depth_mm);
  }
  for (const auto& gain : report.gains) {
    fmt::print("gain {}: a press is {:.4f} mm off the sphere under the list of the others{}\n",
               gain.name, gain.error_mm, gain.chosen ? " (used)" : "");
  }
  return made;
}

void check(const Options& options) {
  const bool many = !options.presses.empty();
  if (many == !options.ball.empty()) {
    throw std::runtime_error("either --ball (one press) or --press for each of several is needed");
  }
  if (many ? options.method == "published" : options.method == "regression") {
    throw std::runtime_error(many ? "--method published takes one press: --ball"
                                  : "--method regression takes several presses: --press");
  }
}

void run(const Options& options) {
  check(options);
  const ImageSet reference = load_images(options.reference, "--reference");
  calibration::Calibration made = options.presses.empty() ? make_from_one(options, reference)
                                                          : make_from_many(options, reference);
  made.origin.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  calibration::save(made, options.output);

  const recon::DepthList& list = made.model->list;
  const auto at = [&](int q6) {
    return 0.001 * list.um[static_cast<std::size_t>(q6 - list.first_q6)];
  };
  fmt::print("{}: method {}, {} reference image(s), {}x{} at column {}, row {}\n", options.output,
             options.method, reference.images.size(), made.model->rectify.width,
             made.model->rectify.height, made.crop_col, made.crop_row);
  fmt::print("list: {:.1f} grey levels = {:.3f} mm to {:.1f} grey levels = {:.3f} mm\n",
             list.covered_from_q6 / 64.0, at(list.covered_from_q6), list.covered_to_q6 / 64.0,
             at(list.covered_to_q6));
  for (const auto& row : made.model->uncertainty) {
    fmt::print("uncertain at {:.2f} mm by {:.1f} um\n", row.depth_mm, row.error_um);
  }
}

}  // namespace

void add_calibrate(CLI::App& app) {
  CLI::App* calibrate = app.add_subcommand("calibrate", "Make a calibration");
  calibrate->require_subcommand(1);
  CLI::App* depth = calibrate->add_subcommand(
      "depth", "Make the list of darkening and indentation from the press of a ball");
  const auto options = std::make_shared<Options>();
  depth
      ->add_option("--reference", options->reference,
                   "Untouched surface: PNG files, or a folder of them (averaged)")
      ->required();
  depth->add_option("--ball", options->ball,
                    "One press of the ball: PNG files, or a folder of them (averaged)");
  depth
      ->add_option("--press", options->presses,
                   "One of several presses, at any place and depth, some of them light: a PNG file "
                   "or a folder; repeat. FOLDER@MM where the depth was measured")
      ->take_all();
  depth->add_option("--radius-mm", options->radius_mm, "Radius of the ball, mm")->required();
  depth->add_option("--mm-per-px", options->mm_per_px,
                    "Scale of the depth map, mm per pixel (default: the lens's in the middle)");
  depth->add_option("--lens", options->lens,
                    "Lens file of calibrate lens, or a calibration folder: rectifies the map");
  depth
      ->add_option("--centre", options->centre,
                   "Middle of the crop in the frame (default: the frame's)")
      ->delimiter(',')
      ->expected(2)
      ->type_name("ROW,COL");
  depth->add_option("--crop", options->crop, "Size of the depth map (default: the whole frame)")
      ->delimiter(',')
      ->expected(2)
      ->type_name("H,W");
  depth
      ->add_option("--method", options->method,
                   "list (default); to compare with: published (one press), regression (several)")
      ->check(CLI::IsMember({"list", "published", "regression"}));
  depth
      ->add_option("--gain-centre", options->gain_centre,
                   "Where the regression's distance is taken from, mm right and down of the middle")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y");
  depth
      ->add_option("-o,--output", options->output,
                   "Folder to write; an old calibration is replaced")
      ->required();
  depth->callback([options] { run(*options); });
  add_calibrate_lens(*calibrate);
}

}  // namespace dtact::ctl
