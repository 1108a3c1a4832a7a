#include "hal/libcamera/libcamera_camera.hpp"

#include <fmt/format.h>
#include <libcamera/camera_manager.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/libcamera/dma_buffer.hpp"
#include "hal/libcamera/formats.hpp"
#include "hal/libcamera/manager.hpp"
#include "hal/libcamera/photometry.hpp"
#include "hal/libcamera/session.hpp"
#include "hal/live/live_camera.hpp"
#include "hal/live/search_throttle.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using live::DeviceError;

std::shared_ptr<lc::Camera> find(lc::CameraManager& manager, const std::string& id) {
  const std::vector<std::shared_ptr<lc::Camera>> cameras = manager.cameras();
  std::string names;
  for (const auto& camera : cameras) {
    if (camera->id() == id) return camera;
    names += (names.empty() ? "attached: " : ", ") + camera->id();
  }
  if (id.empty() && cameras.size() == 1) return cameras.front();
  if (names.empty()) names = "libcamera sees no camera";
  throw DeviceError(CameraState::unplugged,
                    id.empty() && !cameras.empty()
                        ? fmt::format("several cameras are attached: set camera.libcamera.device "
                                      "to one of them ({})",
                                      names)
                        : fmt::format("no camera {} is attached: plug it in, or set "
                                      "camera.libcamera.device ({})",
                                      id, names));
}

live::Opener opener(const CameraConfig& config) {
  return [config, lock = PhotometricLock(config.libcamera, config.fps),
          heap = std::make_shared<DmaHeap>()]() -> live::Opened {
    auto manager = std::make_unique<Manager>();
    std::shared_ptr<lc::Camera> camera = find(**manager, config.libcamera.device);
    const bool cached = driver_memory_is_cached(sensor_of(camera->properties()));
    const std::string id = camera->id();
    // Nothing of the camera stays here: the session gives it back before the manager ends.
    const auto session = std::make_shared<Session>(std::move(manager), std::move(camera), config,
                                                   lock, cached ? nullptr : heap.get());
    return {session, id, session->pixel_format(), session->controls(), session->settings()};
  };
}

}  // namespace

void check(const CameraConfig& config) {
  check_pixel_format(config.libcamera.pixel_format);
  (void)PhotometricLock(config.libcamera, config.fps);
}

std::unique_ptr<Camera> make_camera(const CameraConfig& config) {
  check(config);
  // libcamera's chatter is for its developers. It reads this at its first line, and has no call for
  // it that works for all its parts.
  ::setenv("LIBCAMERA_LOG_LEVELS", "*:ERROR", /*overwrite=*/0);
  return std::make_unique<live::LiveCamera>(config, "libcamera", config.libcamera.device,
                                            live::paced(opener(config)));
}

}  // namespace dtact::hal::libcamera_backend
