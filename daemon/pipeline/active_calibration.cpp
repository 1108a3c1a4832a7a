#include "daemon/pipeline/active_calibration.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "daemon/calibration/mismatch.hpp"

namespace dtact::pipeline {
namespace {

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

/// The calibration for the frames as they are decoded.
std::shared_ptr<const calibration::Calibration> for_frames(
    const std::shared_ptr<const calibration::Calibration>& calibration,
    const hal::CameraInfo& camera) {
  const recon::RectifyTable& table = calibration->model->rectify;
  if (table.frame_width == camera.width && table.frame_height == camera.height) return calibration;
  if (!fits(*calibration, camera)) {
    throw std::invalid_argument(fmt::format(
        "calibration \"{}\" is for frames of {}x{} pixels, the camera delivers {}: set "
        "camera.width, camera.height and camera.decode_scale to the calibration's, or calibrate in "
        "this mode",
        calibration->name, table.frame_width, table.frame_height,
        calibration::FrameSize{camera.width, camera.height, camera.decode_scale}.text()));
  }
  return calibration::for_scaled_frames(calibration, camera.decode_scale);
}

}  // namespace

std::unique_ptr<ActiveCalibration> activate(
    const std::shared_ptr<const calibration::Calibration>& calibration,
    const hal::CameraInfo& camera, const ReconstructionRules& rules) {
  CalibratedImage image(for_frames(calibration, camera));
  Resolutions maps(image.calibration->model, image.cells.lattice(), rules);
  const bool differs = camera_differs(*image.calibration, camera);
  return std::make_unique<ActiveCalibration>(ActiveCalibration{
      .image = std::move(image), .maps = std::move(maps), .camera_mismatch = differs});
}

bool fits(const calibration::Calibration& calibration, const hal::CameraInfo& camera) {
  const recon::RectifyTable& table = calibration.model->rectify;
  return calibration::FrameSize{camera.width, camera.height, camera.decode_scale}.gives(
      table.frame_width, table.frame_height);
}

bool camera_differs(const calibration::Calibration& calibration, const hal::CameraInfo& camera) {
  return !calibration::camera_mismatches(calibration, attached(camera)).empty();
}

}  // namespace dtact::pipeline
