#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/config.hpp"
#include "hal/light_ring.hpp"

namespace dtact::hal {

struct Devices {
  std::unique_ptr<LightRing> ring;
  std::unique_ptr<Camera> camera;
};

/// The names that `camera.backend` and `ring.backend` may have.
[[nodiscard]] std::vector<std::string> camera_backends();
[[nodiscard]] std::vector<std::string> ring_backends();

/// Makes the camera and the ring that the configuration names. The simulated camera sees the
/// simulated ring's light; with any other ring it sees the calibration light (all white).
/// Throws std::runtime_error naming the backend, what failed and the fix.
[[nodiscard]] Devices open_devices(const Config& config);

/// Checks what can be checked without a device, so that what passes can be opened where it is
/// attached: a scene is read, a recording is read and its first frame decoded, settings of real
/// devices fit each other. Throws as open_devices().
void check_devices(const Config& config);

}  // namespace dtact::hal
