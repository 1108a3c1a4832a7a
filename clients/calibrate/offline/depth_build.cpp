#include "clients/calibrate/offline/depth_build.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <stdexcept>

#include "clients/calibrate/fit/camera_height.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "clients/calibrate/fit/model/model_build.hpp"
#include "clients/common/program.hpp"
#include "daemon/calibration/sensor_files.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

constexpr double kMinScale = 0.001;  // mm per pixel
constexpr double kMaxScale = 1.0;

std::optional<calibration::Crop> crop_of(const MapOptions& options, int width, int height) {
  if (options.crop.empty()) {
    if (!options.centre.empty()) throw std::runtime_error("--centre needs --crop WIDTH,HEIGHT");
    return std::nullopt;
  }
  const std::vector<int> centre =
      options.centre.empty() ? std::vector<int>{width / 2, height / 2} : options.centre;
  const calibration::Crop crop{centre[0] - options.crop[0] / 2, centre[1] - options.crop[1] / 2,
                               options.crop[0], options.crop[1]};
  if (crop.width < 1 || crop.height < 1 || crop.col < 0 || crop.row < 0 ||
      crop.width > width - crop.col || crop.height > height - crop.row) {
    throw std::runtime_error(
        fmt::format("--crop: {}x{} around {},{} leaves the picture of {}x{}: make it smaller, or "
                    "move --centre",
                    crop.width, crop.height, centre[0], centre[1], width, height));
  }
  return crop;
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

/// Throws where a pixel's error at both ends would be more than two percent of the scale.
double scale_of(const std::vector<double>& ruler, int width, int height) {
  const auto outside = [](double at, int size) { return !(at >= 0 && at < size); };
  if (outside(ruler[0], width) || outside(ruler[1], height) || outside(ruler[2], width) ||
      outside(ruler[3], height)) {
    throw std::runtime_error(
        fmt::format("--ruler: a point is outside of the picture of {}x{} pixels", width, height));
  }
  const double pixels = std::hypot(ruler[2] - ruler[0], ruler[3] - ruler[1]);
  if (!(pixels >= 100)) {
    throw std::runtime_error(fmt::format(
        "--ruler: the points are {:.0f} pixels apart, which gives no exact scale; at least 100 are "
        "needed",
        pixels));
  }
  const double scale = ruler[4] / pixels;
  if (!(scale >= kMinScale && scale <= kMaxScale)) {
    throw std::runtime_error(
        fmt::format("--ruler: {} mm on {:.1f} pixels is {:.5f} mm per pixel, allowed are {} to {}",
                    ruler[4], pixels, scale, kMinScale, kMaxScale));
  }
  return scale;
}

/// A LUT at the assumed height: of the known sphere or, where its presses do not suffice and a gel
/// may make up for them, of that.
recon::DepthLut rough_lut(const calibration::BallPresses& set, const recon::FlatFieldGain& gain,
                          FitMethod method) {
  try {
    calibration::PressReport unused;
    return calibration::build_from_sphere(set, gain, unused).model->lut;
  } catch (const std::runtime_error&) {
    if (method == FitMethod::alone) throw;
    try {
      return calibration::build_model(set, gain).calibration.model->lut;
    } catch (const std::runtime_error&) {
      if (method == FitMethod::model) throw;
    }
    throw;  // the sphere's reason names the press that is missing
  }
}

/// Splits "FOLDER@0.8" into the images and the measured depth.
std::pair<std::string, std::optional<double>> split_press(const std::string& text) {
  const std::size_t at = text.rfind('@');
  // One in a folder's name is no depth's.
  if (at == std::string::npos || text.find('/', at) != std::string::npos || fs::exists(text)) {
    return {text, std::nullopt};
  }
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
  CLI::Option* scale =
      command
          .add_option("--mm-per-px", options.mm_per_px,
                      "Scale of the depth map, mm per pixel (default: the lens's in the middle)")
          ->check(cli::in_range(kMinScale, kMaxScale));
  CLI::Option* ruler =
      command
          .add_option("--ruler", options.ruler,
                      "The scale from a ruler or coin pressed in: two points of the picture of "
                      "dtactctl snapshot --luma, pixels, and their distance, mm")
          ->delimiter(',')
          ->expected(5)
          ->type_name("X,Y,X,Y,MM")
          ->excludes(scale);
  command
      .add_option("--lens", options.lens,
                  "Lens file of calibrate lens, or a calibration folder: rectifies the map; a "
                  "LUT of one press takes its gain as well, several presses tell their own")
      ->type_name("FILE")
      ->excludes(ruler);
  add_camera_option(command, options.camera_mm, "the lens file's, or as four presses show");
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

void add_camera_option(CLI::App& command, double& camera_mm, const std::string& otherwise) {
  command
      .add_option("--camera-mm", camera_mm,
                  "Height of the camera's pinhole above the surface as it looks through the gel, "
                  "mm, where a drawing says it (default: " +
                      otherwise + ")")
      ->check(cli::in_range(5.0, 1000.0));
}

calibration::CameraView view_of(const PinShift& shift, double camera_mm) {
  if (camera_mm > 0) return {shift.foot_mm, calibration::HeightSource::drawing, 1 / camera_mm};
  if (!shift.sure()) {
    return {shift.foot_mm, calibration::HeightSource::assumed, calibration::kAssumedPerMm};
  }
  return {shift.foot_mm, calibration::HeightSource::board, 0, shift.per_level, shift.error};
}

MapChoice choose_map(const MapOptions& options, int frame_width, int frame_height) {
  MapChoice map{.lens = {},
                .gain = {},
                .mm_per_px = options.mm_per_px,
                .scale_from = "--mm-per-px",
                .crop = crop_of(options, frame_width, frame_height)};
  if (!options.lens.empty()) {
    const calibration::LensFile file = lens_for(options.lens, frame_width, frame_height);
    map.lens = file.lens;
    map.gain = file.gain;
    map.gain_specified = file.gain_specified;
    map.view = file.view;
    if (map.mm_per_px == 0) {
      map.mm_per_px = recon::central_mm_per_px(*map.lens);
      map.scale_from = "the lens";
    }
  } else if (!options.ruler.empty()) {
    map.mm_per_px = scale_of(options.ruler, frame_width, frame_height);
    map.scale_from =
        fmt::format("a ruler, {} mm from {}, {} to {}, {}", options.ruler[4], options.ruler[0],
                    options.ruler[1], options.ruler[2], options.ruler[3]);
  } else if (map.mm_per_px == 0) {
    throw std::runtime_error(
        "the scale of the picture is missing. From a board of pins: dtact-calibrate lens, then "
        "--lens. From a ruler or coin: press it in, dtactctl snapshot --luma -o ruler.png, then "
        "--ruler X,Y,X,Y,MM with two of its points and their distance. Known: --mm-per-px");
  }
  if (map.view.source == calibration::HeightSource::unknown) {
    map.view.source = calibration::HeightSource::assumed;
    map.view.per_mm = calibration::kAssumedPerMm;
    if (map.lens) {
      map.view.foot_mm = axis_foot(*map.lens);
    } else if (map.crop) {
      // The camera's axis is taken to be in the middle of the frame.
      map.view.foot_mm = {
          map.mm_per_px * 0.5 * (frame_width - map.crop->width - 2 * map.crop->col),
          map.mm_per_px * 0.5 * (frame_height - map.crop->height - 2 * map.crop->row)};
    }
  }
  if (options.camera_mm > 0) {
    map.view.source = calibration::HeightSource::drawing;
    map.view.per_mm = 1 / options.camera_mm;
    map.view.error = 0;
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
                             .view = choice.view,
                             .gain_specified = choice.gain_specified},
                     .gain = choice.gain,
                     .origin = recorded_origin(reference)};
  images.origin.scale_from = choice.scale_from;
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
  calibration::BallPresses set = images.set;
  if (set.view.per_mm == 0 && set.view.source != calibration::HeightSource::unknown) {
    // A LUT at the assumed height turns the board's grey levels into millimetres.
    set.view = calibration::view_with(set.view, rough_lut(set, images.gain, method));
  }
  set.view = calibration::view_of_presses(set);
  if (method == FitMethod::automatic) {
    made = calibration::build_auto(set, images.gain, found);
  } else if (method == FitMethod::alone) {
    made = calibration::build_from_sphere(set, images.gain, found);
  } else {
    calibration::FittedCalibration fitted = calibration::build_model(set, images.gain);
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
  add_note(calibration::describe(made.view));
  add_note(calibration::dim_part_of(made, set));
  made.origin = images.origin;
  made.origin.created = utc_now();
  if (report != nullptr) *report = std::move(found);
  return made;
}

void save_or_refuse(const calibration::Calibration& made, const std::vector<std::string>& doubts,
                    bool force, const std::string& folder, const std::string& hint) {
  // Comes before the doubts: the daemon refuses the map even where --force has written it.
  pipeline::require_coverage(made.model->rectify, folder);
  if (!doubts.empty() && !force) {
    throw std::runtime_error(fmt::format("{}{}; nothing was written (--force writes it as it is)",
                                         fmt::join(doubts, "; "), hint));
  }
  for (const std::string& doubt : doubts) fmt::print("doubtful: {}\n", doubt);
  calibration::save(made, folder);
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
