#pragma once

#include "hal/config.hpp"
#include "hal/live/live_camera.hpp"

namespace dtact::hal::v4l2 {

/// A camera behind a V4L2 driver.
class V4l2Camera final : public live::LiveCamera {
 public:
  /// Throws std::runtime_error naming the key for a configuration that can never work. Opens
  /// nothing.
  explicit V4l2Camera(const CameraConfig& config);
};

}  // namespace dtact::hal::v4l2
