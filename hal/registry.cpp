#include "hal/registry.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>

#include "hal/libcamera/libcamera_camera.hpp"
#include "hal/null/null.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/sim/sim_camera.hpp"
#include "hal/sim/sim_ring.hpp"
#include "hal/v4l2/finder.hpp"
#include "hal/v4l2/photometry.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#include "hal/ws2812/ring.hpp"

namespace dtact::hal {

std::vector<std::string> camera_backends() {
  return {"null", "replay", "sim", "v4l2", "libcamera"};
}
std::vector<std::string> ring_backends() { return {"null", "sim", "ws2812_pio", "ws2812_spi"}; }

Devices open_devices(const Config& config) {
  // The one thing camera and ring share is the light in the simulated sensor.
  const auto light = std::make_shared<sim::LightLink>();
  Devices devices;

  if (config.ring.backend == "null") {
    devices.ring = std::make_unique<null::NullRing>();
  } else if (config.ring.backend == "sim") {
    devices.ring = std::make_unique<sim::SimRing>(light);
  } else if (config.ring.backend == "ws2812_pio") {
    devices.ring = ws2812::open_pio_ring(config.ring.ws2812);
  } else if (config.ring.backend == "ws2812_spi") {
    devices.ring = ws2812::open_spi_ring(config.ring.ws2812);
  } else {
    throw std::runtime_error(fmt::format("ring.backend = \"{}\": allowed are {}",
                                         config.ring.backend, fmt::join(ring_backends(), ", ")));
  }

  if (config.camera.backend == "null") {
    devices.camera = std::make_unique<null::NullCamera>(config.camera);
  } else if (config.camera.backend == "replay") {
    devices.camera = std::make_unique<replay::ReplayCamera>(config.camera);
  } else if (config.camera.backend == "sim") {
    devices.camera = std::make_unique<sim::SimCamera>(config.camera, light);
  } else if (config.camera.backend == "v4l2") {
    devices.camera = std::make_unique<v4l2::V4l2Camera>(config.camera);
  } else if (config.camera.backend == "libcamera") {
    devices.camera = libcamera_backend::make_camera(config.camera);
  } else {
    throw std::runtime_error(fmt::format("camera.backend = \"{}\": allowed are {}",
                                         config.camera.backend,
                                         fmt::join(camera_backends(), ", ")));
  }
  return devices;
}

void check_devices(const Config& config) {
  const CameraConfig& camera = config.camera;
  if (camera.backend == "replay") replay::check(camera);
  if (camera.backend == "sim") sim::check(camera);
  if (camera.backend == "v4l2") {
    (void)v4l2::DeviceName(camera.v4l2.device);
    (void)v4l2::PhotometricLock(camera.v4l2);
  }
  if (camera.backend == "libcamera") libcamera_backend::check(camera);
  if (config.ring.backend == "ws2812_spi") ws2812::check_spi(config.ring.ws2812);
}

}  // namespace dtact::hal
