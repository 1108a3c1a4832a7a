#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/offline/drawing.hpp"
#include "clients/calibrate/offline/images.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

struct Options {
  std::string calibration;
  std::vector<std::string> reference;
  std::string frame;
  std::string output;
};

void run(const Options& options) {
  const cli::DepthEncoder encode = cli::encoder_for(options.output, encode_legend_png);
  const calibration::Calibration calibration = calibration::load(options.calibration);
  const ImageSet reference = load_images(options.reference, "--reference");
  const ImageSet frame = load_images({options.frame}, "--frame");
  require_same_size(reference, "--reference", frame, "--frame");
  const recon::Model& model = *calibration.model;
  if (frame.width() != model.rectify.frame_width || frame.height() != model.rectify.frame_height) {
    throw std::runtime_error(fmt::format("--frame is {}x{} but the calibration is for {}x{}",
                                         frame.width(), frame.height(), model.rectify.frame_width,
                                         model.rectify.frame_height));
  }
  std::vector<float> mm =
      calibration::mean_depth_um(model, reference.mean_q8().pixels, frame.frames());
  for (float& value : mm) value *= 0.001F;
  base::write_file_atomically(options.output, encode({.width = model.rectify.width,
                                                      .height = model.rectify.height,
                                                      .mm_per_px = model.mm_per_px,
                                                      .mm = mm,
                                                      .surface = model.surface}));

  float deepest = 0;
  std::size_t untrusted = 0;
  for (const float value : mm) {
    if (std::isnan(value)) {
      ++untrusted;
    } else {
      deepest = std::max(deepest, value);
    }
  }
  fmt::print("{}: {}x{}, deepest {:.3f} mm, {} pixels untrusted\n", options.output,
             model.rectify.width, model.rectify.height, deepest, untrusted);
}

}  // namespace

void add_apply(CLI::App& app) {
  CLI::App* apply = app.add_subcommand("apply", "Make the depth of an image, as the daemon does");
  const auto options = std::make_shared<Options>();
  apply->add_option("--calibration", options->calibration, "Calibration folder")
      ->type_name("FOLDER")
      ->required();
  apply
      ->add_option("--reference", options->reference,
                   "Undeformed surface: PNG files, or a folder of them (averaged)")
      ->type_name("FILE")
      ->required();
  apply->add_option("--frame", options->frame, "The image: a PNG file")
      ->type_name("FILE")
      ->required();
  apply
      ->add_option("-o,--output", options->output,
                   "depth.npy (float32 mm), depth.png (colours), depth.ply or .pcd (points)")
      ->type_name("FILE")
      ->required();
  apply->callback([options] { run(*options); });
}

}  // namespace dtact::ctl
