#pragma once

#include <memory>

#include "daemon/calibration/calibration.hpp"
#include "daemon/pipeline/depth/resolutions.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/pipeline/reference/calibrated_image.hpp"
#include "hal/camera.hpp"

namespace dtact::pipeline {

/// A calibration ready for the capture thread: needs no more memory and no slow work. Made on a
/// worker thread, used on the capture thread, freed on the network thread.
struct ActiveCalibration {
  CalibratedImage image;
  Resolutions maps;
  bool camera_mismatch = false;
};

/// A calibration for the JPEGs of a camera whose frames are decoded at a smaller size becomes one
/// for its frames (recon::for_scaled_frames()): image.calibration. Throws std::invalid_argument
/// with the fix when the calibration cannot be used with frames of this camera at all (other
/// differences set a health flag) or with these rules.
[[nodiscard]] std::unique_ptr<ActiveCalibration> activate(
    const std::shared_ptr<const calibration::Calibration>& calibration,
    const hal::CameraInfo& camera, const ReconstructionRules& rules);

/// The camera gives frames of the calibration's size, or decodes them from JPEGs that have it.
[[nodiscard]] bool fits(const calibration::Calibration& calibration, const hal::CameraInfo& camera);

/// The camera, its mode or its controls are not those of a calibration that was made for its
/// frames.
[[nodiscard]] bool camera_differs(const calibration::Calibration& calibration,
                                  const hal::CameraInfo& camera);

}  // namespace dtact::pipeline
