#include "hal/libcamera/libcamera_camera.hpp"

#include <fmt/format.h>
#include <libcamera/camera_manager.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/libcamera/dma_buffer.hpp"
#include "hal/libcamera/formats.hpp"
#include "hal/libcamera/photometry.hpp"
#include "hal/libcamera/session.hpp"
#include "hal/live/device_error.hpp"
#include "hal/live/live_camera.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;
using live::DeviceError;

/// libcamera allows one manager a process; it lives as long as a camera does.
std::shared_ptr<lc::CameraManager> shared_manager() {
  static std::mutex mutex;
  static std::weak_ptr<lc::CameraManager> present;
  const std::lock_guard guard(mutex);
  if (auto manager = present.lock()) return manager;
  auto manager = std::make_shared<lc::CameraManager>();
  if (const int e = manager->start(); e != 0) {
    throw DeviceError(CameraState::unplugged,
                      fmt::format("libcamera does not start ({})", std::strerror(-e)));
  }
  present = manager;
  return manager;
}

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

/// Finds the camera in libcamera's view of the machine. libcamera follows plugging by udev's
/// events, and a manager that starts while a camera's nodes are just appearing can miss the last of
/// them for good: after a while without the camera the search begins anew with a manager of its own
/// (unless another camera of this process keeps the present one). Cameras go back to their manager
/// before it ends, so the session with the lost camera ends with it.
class Search {
 public:
  explicit Search(std::string id) : id_(std::move(id)) {}

  /// Throws DeviceError as find(). `before`: the session with the camera that was lost, or null.
  std::shared_ptr<lc::Camera> operator()(std::shared_ptr<Session>& before) {
    if (!manager_) manager_ = shared_manager();
    try {
      std::shared_ptr<lc::Camera> camera = find(*manager_, id_);
      missing_since_.reset();
      return camera;
    } catch (const DeviceError&) {
      const auto now = std::chrono::steady_clock::now();
      if (!missing_since_) missing_since_ = now;
      // Whoever still waits for a frame of it holds the session for a moment.
      if (now - *missing_since_ > kPatience && before.use_count() <= 1) {
        before.reset();
        manager_.reset();
        missing_since_.reset();
      }
      throw;
    }
  }

 private:
  static constexpr std::chrono::seconds kPatience{5};
  std::string id_;
  std::shared_ptr<lc::CameraManager> manager_;
  std::optional<std::chrono::steady_clock::time_point> missing_since_;
};

live::Opener opener(const CameraConfig& config) {
  check_pixel_format(config.libcamera.pixel_format);
  return [config, lock = PhotometricLock(config.libcamera, config.fps),
          search = Search(config.libcamera.device), heap = std::make_shared<DmaHeap>(),
          session = std::shared_ptr<Session>()]() mutable -> live::Opened {
    const std::shared_ptr<lc::Camera> camera = search(session);
    session.reset();  // the one before, which see
    const bool cached = driver_memory_is_cached(sensor_of(camera->properties()));
    session = std::make_shared<Session>(camera, config, lock, cached ? nullptr : heap.get());
    return {session, camera->id(), session->pixel_format(), session->controls()};
  };
}

}  // namespace

std::unique_ptr<Camera> make_camera(const CameraConfig& config) {
  // libcamera's chatter is for its developers. It reads this at its first line, and has no call for
  // it that works for all its parts.
  ::setenv("LIBCAMERA_LOG_LEVELS", "*:ERROR", /*overwrite=*/0);
  return std::make_unique<live::LiveCamera>(config, "libcamera", config.libcamera.device,
                                            opener(config));
}

}  // namespace dtact::hal::libcamera_backend
