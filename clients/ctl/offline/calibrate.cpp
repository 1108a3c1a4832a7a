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

namespace dtact::ctl {
namespace {

struct Options {
  std::vector<std::string> reference;
  std::vector<std::string> ball;
  double radius_mm = 0;
  double mm_per_px = 0;  ///< 0: the lens's.
  std::string lens;
  std::vector<int> centre;  ///< Row, column.
  std::vector<int> crop;    ///< Height, width.
  std::string method = "list";
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

void run(const Options& options) {
  const ImageSet reference = load_images(options.reference, "--reference");
  const ImageSet ball = load_images(options.ball, "--ball");
  require_same_size(reference, "--reference", ball, "--ball");
  calibration::BallPress press;
  press.reference_q8 = reference.mean_q8();
  press.frames = ball.frames();
  press.ball_radius_mm = options.radius_mm;
  press.mm_per_px = options.mm_per_px;
  if (!options.lens.empty()) {
    press.lens = lens_for(options.lens, reference);
    if (press.mm_per_px == 0) press.mm_per_px = recon::central_mm_per_px(*press.lens);
  } else if (press.mm_per_px == 0) {
    throw std::runtime_error("--mm-per-px or --lens is required: one of them says the scale");
  }
  press.crop = crop_of(options, reference.width(), reference.height());
  press.method = options.method == "published" ? recon::Method::published : recon::Method::list;

  calibration::Calibration made = calibration::build(press);
  made.origin.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  made.origin.sources = reference.sources;
  made.origin.sources.insert(made.origin.sources.end(), ball.sources.begin(), ball.sources.end());
  calibration::save(made, options.output);

  const recon::DepthList& list = made.model->list;
  const auto at = [&](int q6) {
    return 0.001 * list.um[static_cast<std::size_t>(q6 - list.first_q6)];
  };
  fmt::print("{}: method {}, {} reference and {} ball image(s), {}x{} at column {}, row {}\n",
             options.output, options.method, reference.images.size(), ball.images.size(),
             made.model->rectify.width, made.model->rectify.height, made.crop_col, made.crop_row);
  fmt::print("list: {:.1f} grey levels = {:.3f} mm to {:.1f} grey levels = {:.3f} mm\n",
             list.covered_from_q6 / 64.0, at(list.covered_from_q6), list.covered_to_q6 / 64.0,
             at(list.covered_to_q6));
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
  depth
      ->add_option("--ball", options->ball,
                   "The ball pressed in: PNG files, or a folder of them (averaged)")
      ->required();
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
  depth->add_option("--method", options->method, "list (default) or published, to compare with")
      ->check(CLI::IsMember({"list", "published"}));
  depth
      ->add_option("-o,--output", options->output,
                   "Folder to write; an old calibration is replaced")
      ->required();
  depth->callback([options] { run(*options); });
  add_calibrate_lens(*calibrate);
}

}  // namespace dtact::ctl
