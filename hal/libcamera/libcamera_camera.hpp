#pragma once

#include <memory>

#include "hal/camera.hpp"
#include "hal/config.hpp"

namespace dtact::hal::libcamera_backend {

/// Throws std::runtime_error naming the key for a configuration that can never work, or saying that
/// this program was built without libcamera.
void check(const CameraConfig& config);

/// A camera reached by libcamera: CSI cameras, whose raw V4L2 nodes are of no use by themselves.
/// Opens nothing yet. Throws as check().
[[nodiscard]] std::unique_ptr<Camera> make_camera(const CameraConfig& config);

}  // namespace dtact::hal::libcamera_backend
