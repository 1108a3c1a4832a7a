#include "clients/calibrate/offline/depth_build.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <stdexcept>

#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"
#include "clients/common/program.hpp"
#include "daemon/calibration/sensor_files.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

std::optional<calibration::Crop> crop_of(const MapOptions& options, int width, int height) {
  if (options.crop.empty()) {
    if (!options.centre.empty()) throw std::runtime_error("--centre needs --crop WIDTH,HEIGHT");
    return std::nullopt;
  }
  const std::vector<int> centre =
      options.centre.empty() ? std::vector<int>{width / 2, height / 2} : options.centre;
  return calibration::Crop{centre[0] - options.crop[0] / 2, centre[1] - options.crop[1] / 2,
                           options.crop[0], options.crop[1]};
}

calibration::LensFile lens_for(const std::string& path, int width, int height) {
  calibration::LensFile file = calibration::load_lens(path);
  if (file.frame_width != width || file.frame_height != height) {
    throw std::runtime_error(fmt::format(
        "--lens: {} was measured on {}x{} but the images are {}x{}; both must come from one camera "
        "mode",
        path, file.frame_width, file.frame_height, width, height));
  }
  return file;
}

/// Splits "FOLDER@0.8" into the images and the measured depth.
std::pair<std::string, std::optional<double>> split_press(const std::string& text) {
  const std::size_t at = text.rfind('@');
  if (at == std::string::npos) return {text, std::nullopt};
  double depth_mm = 0;
  std::size_t read = 0;
  try {
    depth_mm = std::stod(text.substr(at + 1), &read);
  } catch (const std::exception&) {
    read = 0;
  }
  if (read == 0 || read != text.size() - at - 1 || !(depth_mm > 0 && depth_mm < 100)) {
    throw std::runtime_error("--press " + text + ": after @ comes a depth in millimetres");
  }
  return {text.substr(0, at), depth_mm};
}

}  // namespace

void add_map_options(CLI::App& command, MapOptions& options) {
  command
      .add_option("--mm-per-px", options.mm_per_px,
                  "Scale of the depth map, mm per pixel (default: the lens's in the middle)")
      ->check(cli::in_range(0.001, 1.0));
  command
      .add_option("--lens", options.lens,
                  "Lens file of calibrate lens, or a calibration folder: rectifies the map; a "
                  "LUT of one press takes its gain as well, several presses tell their own")
      ->type_name("FILE");
  command
      .add_option("--centre", options.centre,
                  "Middle of the crop in the frame (default: the frame's)")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y");
  command.add_option("--crop", options.crop, "Size of the depth map (default: the whole frame)")
      ->delimiter(',')
      ->expected(2)
      ->type_name("W,H");
}

MapChoice choose_map(const MapOptions& options, int frame_width, int frame_height) {
  MapChoice map{.lens = {},
                .gain = {},
                .mm_per_px = options.mm_per_px,
                .crop = crop_of(options, frame_width, frame_height)};
  if (!options.lens.empty()) {
    const calibration::LensFile file = lens_for(options.lens, frame_width, frame_height);
    map.lens = file.lens;
    map.gain = file.gain;
    map.gain_specified = file.gain_specified;
    if (map.mm_per_px == 0) map.mm_per_px = recon::central_mm_per_px(*map.lens);
  } else if (map.mm_per_px == 0) {
    throw std::runtime_error("--mm-per-px or --lens is required: one of them says the scale");
  }
  return map;
}

PressImages begin_presses(const std::vector<std::string>& reference, double ball_radius_mm,
                          const MapOptions& map) {
  const ImageSet reference_image = load_images(reference, "--reference");
  const MapChoice choice = choose_map(map, reference_image.width(), reference_image.height());
  PressImages images{.set = {.reference_q8 = reference_image.mean_q8(),
                             .presses = {},
                             .ball_radius_mm = ball_radius_mm,
                             .mm_per_px = choice.mm_per_px,
                             .crop = choice.crop,
                             .lens = choice.lens,
                             .gain_specified = choice.gain_specified},
                     .gain = choice.gain,
                     .origin = recorded_origin(reference)};
  images.origin.sources = reference_image.sources;
  return images;
}

void add_press(PressImages& images, const std::vector<std::string>& paths, const char* option) {
  ImageSet pressed = load_images(paths, option);
  const image::Grey16& reference = images.set.reference_q8;
  if (pressed.width() != reference.width || pressed.height() != reference.height) {
    throw std::runtime_error(fmt::format(
        "{} {} is {}x{} but --reference is {}x{}; both must come from one camera mode", option,
        paths.front(), pressed.width(), pressed.height(), reference.width, reference.height));
  }
  images.set.presses.push_back(
      {.name = paths.front(), .frames = pressed.frames(), .depth_mm = std::nullopt});
  images.origin.sources.insert(images.origin.sources.end(), pressed.sources.begin(),
                               pressed.sources.end());
}

void add_press(PressImages& images, const std::string& press) {
  const auto [path, depth_mm] = split_press(press);
  const fs::path folder = fs::weakly_canonical(path);
  for (const calibration::BallPresses::Press& other : images.set.presses) {
    if (fs::weakly_canonical(split_press(other.name).first) != folder) continue;
    throw std::runtime_error("--press " + press + ": the images of " + other.name +
                             " again; give each press once");
  }
  add_press(images, {path}, "--press");
  images.set.presses.back().name = press;
  images.set.presses.back().depth_mm = depth_mm;
}

FitMethod fit_method(const std::string& name) {
  if (name == "list") return FitMethod::alone;
  return name == "model" ? FitMethod::model : FitMethod::automatic;
}

calibration::Calibration build_lut(const PressImages& images, FitMethod method,
                                   calibration::PressReport* report) {
  calibration::PressReport found;
  calibration::Calibration made;
  if (method == FitMethod::automatic) {
    made = calibration::build_auto(images.set, images.gain, found);
  } else if (method == FitMethod::alone) {
    made = calibration::build_from_sphere(images.set, images.gain, found);
  } else {
    calibration::FittedCalibration fitted = calibration::build_model(images.set, images.gain);
    found.note = fitted.describe_press();
    found.left_out = std::move(fitted.left_out);
    found.presses = std::move(fitted.presses);
    made = std::move(fitted.calibration);
  }
  const auto add_note = [&found](const std::string& line) {
    if (!line.empty()) found.note += (found.note.empty() ? "" : "\n") + line;
  };
  // Several presses determine their own gain, but the gel is fitted with the lens file's.
  if (method != FitMethod::alone || images.set.presses.size() == 1) {
    add_note(calibration::gain_left_out(images.gain, made));
  }
  add_note(calibration::dim_part_of(made, images.set));
  made.origin = images.origin;
  made.origin.created = utc_now();
  if (report != nullptr) *report = std::move(found);
  return made;
}

calibration::Origin recorded_origin(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    const fs::path file = fs::path(path) / calibration::kSensorName;
    if (fs::exists(file)) return calibration::load_sensor(file);
  }
  return {};
}

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

std::string report_text(const calibration::PressReport& report) {
  std::string text;
  if (!report.note.empty()) text += report.note + "\n";
  for (const std::string& press : report.left_out) text += fmt::format("left out: {}\n", press);
  for (const auto& press : report.presses) {
    text += fmt::format("{}: {:.3f} mm deep\n", press.name, press.depth_mm);
  }
  for (const auto& gain : report.gains) {
    text +=
        fmt::format("gain {}: a press is {:.4f} mm off the sphere under the LUT of the others{}\n",
                    gain.name, gain.error_mm, gain.chosen ? " (used)" : "");
  }
  return text;
}

std::string lut_text(const recon::Model& model) {
  const recon::DepthLut& lut = model.lut;
  const auto at = [&](int q6) {
    return 0.001 * lut.um[static_cast<std::size_t>(q6 - lut.first_q6)];
  };
  std::string text =
      fmt::format("LUT: {:.1f} grey levels = {:.3f} mm to {:.1f} grey levels = {:.3f} mm\n",
                  lut.covered_from_q6 / 64.0, at(lut.covered_from_q6), lut.covered_to_q6 / 64.0,
                  at(lut.covered_to_q6));
  for (const auto& row : model.uncertainty) {
    text += fmt::format("uncertain at {:.2f} mm by {:.1f} um\n", row.depth_mm, row.error_um);
  }
  return text;
}

std::string gel_text(const calibration::GelEstimate& gel) {
  const auto with_error = [](const calibration::GelEstimate::Estimate& estimate) {
    return fmt::format("{:.2f} ± {:.2f}", estimate.value, estimate.error);
  };
  std::string text = fmt::format(
      "gel: {} mm thick; light spreads sideways by {} mm ({:.0f} ± {:.0f} % of it) and {} mm; "
      "the fit leaves {:.2f} grey levels\n",
      with_error(gel.thickness_mm), with_error(gel.narrow_mm), 100 * gel.narrow_weight.value,
      100 * gel.narrow_weight.error, with_error(gel.wide_mm), gel.residual_levels);
  text += "response: of the light is lost a tenth of a millimetre";
  for (std::size_t i = 0; i < gel.slope.size(); ++i) {
    const double depth_mm = gel.indentation[i] * gel.thickness_mm.value;
    const double percent =
        10 / gel.thickness_mm.value * (gel.indentation[i] < 0 ? gel.bulge_factor : 1);
    text += fmt::format("{} {:.1f} ± {:.1f} % {}", i == 0 ? "" : ",", percent * gel.slope[i].value,
                        percent * gel.slope[i].error,
                        depth_mm == 0  ? "at the surface"
                        : depth_mm < 0 ? fmt::format("on a bulge of {:.2f} mm", -depth_mm)
                                       : fmt::format("at {:.2f} mm", depth_mm));
  }
  return text + "\n";
}

}  // namespace dtact::ctl
