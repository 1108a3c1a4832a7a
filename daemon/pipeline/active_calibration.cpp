#include "daemon/pipeline/active_calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "daemon/calibration/mismatch.hpp"
#include "daemon/pipeline/uncertainty.hpp"
#include "daemon/recon/decimate.hpp"

namespace dtact::pipeline {
namespace {

CellRegion cells_within(const recon::RectifyTable& table) {
  const recon::FrameRegion read = recon::region_read(table);
  const auto first = [](int pixel, int cells, int pixels) {
    return std::min(cells, (pixel * cells + pixels - 1) / pixels);
  };
  CellRegion region{.x0 = first(read.x, kGridWidth, table.frame_width),
                    .y0 = first(read.y, kGridHeight, table.frame_height),
                    .x1 = (read.x + read.width) * kGridWidth / table.frame_width,
                    .y1 = (read.y + read.height) * kGridHeight / table.frame_height};
  region.x1 = std::min(region.x1, kGridWidth);
  region.y1 = std::min(region.y1, kGridHeight);
  return region;
}

calibration::AttachedCamera attached(const hal::CameraInfo& camera) {
  calibration::AttachedCamera now{.identity = camera.identity,
                                  .pixel_format = camera.pixel_format,
                                  .width = camera.width,
                                  .height = camera.height,
                                  .fps = camera.fps,
                                  .controls = {}};
  for (const auto& control : camera.controls) now.controls.push_back({control.name, control.value});
  return now;
}

std::vector<recon::Reconstructor> reconstructors(const std::shared_ptr<const recon::Model>& model,
                                                 const ReconstructionRules& rules) {
  std::vector<recon::Reconstructor> made;
  for (const int decimation : {1, 2, 4}) {
    if (rules.decimation != 0 && rules.decimation != decimation) continue;
    made.emplace_back(decimation == 1 ? model
                                      : std::make_shared<const recon::Model>(
                                            recon::decimate(*model, decimation)));
  }
  return made;
}

}  // namespace

std::unique_ptr<ActiveCalibration> activate(
    const std::shared_ptr<const calibration::Calibration>& calibration,
    const hal::CameraInfo& camera, const ReconstructionRules& rules) {
  const recon::Model& model = *calibration->model;
  const recon::RectifyTable& table = model.rectify;
  if (table.frame_width != camera.width || table.frame_height != camera.height) {
    throw std::invalid_argument(fmt::format(
        "calibration \"{}\" is for frames of {}x{} pixels, the camera delivers {}x{}: set "
        "camera.width and camera.height to the calibration's, or calibrate in this mode",
        calibration->name, table.frame_width, table.frame_height, camera.width, camera.height));
  }
  const CellRegion region = cells_within(table);
  if (region.x1 - region.x0 < 8 || region.y1 - region.y0 < 8) {
    throw std::invalid_argument(
        fmt::format("calibration \"{}\" covers {}x{} pixels of the frame, too little to tell light "
                    "from touch: calibrate with a crop of at least a quarter of each side",
                    calibration->name, table.width, table.height));
  }
  auto active = std::make_unique<ActiveCalibration>(
      ActiveCalibration{.calibration = calibration,
                        .reconstructors = reconstructors(calibration->model, rules),
                        .grid = {},
                        .region = region,
                        .camera_mismatch = camera_differs(*calibration, camera)});
  measure(model.reference_q8, table.frame_width, table.frame_height, active->grid);
  return active;
}

double ActiveCalibration::list_um(double depth_mm) const noexcept {
  const auto& rows = calibration->model->uncertainty;
  if (rows.empty()) return kUnstatedListUm;
  const auto above =
      std::ranges::lower_bound(rows, depth_mm, {}, &recon::Model::Uncertainty::depth_mm);
  if (above == rows.begin()) return rows.front().error_um;
  if (above == rows.end()) return rows.back().error_um;
  const auto below = above - 1;
  return std::lerp(below->error_um, above->error_um,
                   (depth_mm - below->depth_mm) / (above->depth_mm - below->depth_mm));
}

double ActiveCalibration::light_um(double share) const noexcept {
  const recon::DepthList& list = calibration->model->list;
  // The list's slope over the darkening of a light press; 20 grey levels are about 0.6 mm.
  constexpr int kLevels = 20;
  const auto at = [&](int level) {
    const int last = static_cast<int>(list.um.size()) - 1;
    const int i = std::clamp(level * recon::kEntriesPerLevel - list.first_q6, 0, last);
    return static_cast<double>(list.um[static_cast<std::size_t>(i)]);
  };
  return std::abs(share) * grid.mean * (at(kLevels) - at(0)) / kLevels;
}

void ActiveCalibration::set_reference(std::span<const std::uint16_t> reference_q8) noexcept {
  for (recon::Reconstructor& reconstructor : reconstructors) {
    reconstructor.set_reference(reference_q8);
  }
}

void ActiveCalibration::set_light(double factor) noexcept {
  for (recon::Reconstructor& reconstructor : reconstructors) reconstructor.set_light(factor);
}

void ActiveCalibration::use_decimation(int decimation) noexcept {
  for (std::size_t i = 0; i < reconstructors.size(); ++i) {
    if (i == in_use || reconstructors[i].model().rectify.decimation != decimation) continue;
    reconstructors[i].follow(reconstructors[in_use]);
    in_use = i;
    return;
  }
}

bool camera_differs(const calibration::Calibration& calibration, const hal::CameraInfo& camera) {
  return !calibration::camera_mismatches(calibration, attached(camera)).empty();
}

bool light_differs(const calibration::Calibration& calibration, const hal::Light& light) noexcept {
  const auto& then = calibration.origin.leds;
  if (then.empty()) return false;
  if (then.size() != light.leds.size() * 3) return true;
  const auto differs = [&](std::uint8_t channel, std::uint8_t recorded) {
    const int shown = (channel * light.brightness + 127) / 255;
    return std::abs(shown - int{recorded}) > 1;
  };
  for (std::size_t i = 0; i < light.leds.size(); ++i) {
    const hal::Rgb& led = light.leds[i];
    if (differs(led.r, then[3 * i]) || differs(led.g, then[3 * i + 1]) ||
        differs(led.b, then[3 * i + 2])) {
      return true;
    }
  }
  return false;
}

}  // namespace dtact::pipeline
