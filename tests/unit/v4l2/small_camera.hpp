#pragma once

#include <chrono>

#include "hal/v4l2/v4l2_camera.hpp"
#include "tests/unit/v4l2/emulated_camera.hpp"

namespace dtact::hal::v4l2 {

/// The emulated camera's mode, by its serial number.
inline CameraConfig small() {
  CameraConfig c;
  c.width = EmulatedCamera::kWidth;
  c.height = EmulatedCamera::kHeight;
  c.fps = 60;
  c.v4l2.device = "serial:4711";
  return c;
}

/// Grabs until there is a frame; generous, since only order is tested.
inline GrabStatus grab_soon(V4l2Camera& camera, Frame& frame) {
  GrabStatus status = GrabStatus::timeout;
  for (int i = 0; i < 1000 && status != GrabStatus::ok; ++i) {
    status = camera.grab(frame, std::chrono::milliseconds(10));
  }
  return status;
}

}  // namespace dtact::hal::v4l2
