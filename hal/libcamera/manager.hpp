#pragma once

#include <libcamera/camera_manager.h>

namespace dtact::hal::libcamera_backend {

/// This process's manager of cameras, of which libcamera allows one: it begins with the first of
/// these objects and ends with the last. Cameras go back before that (libcamera's contract for
/// CameraManager::stop()).
///
/// It is kept no longer than a camera is used. When a camera that a manager has seen goes and comes
/// again, the manager looks up what it freed (seen with 0.0.3:
/// DeviceEnumeratorUdev::addV4L2Device() finds the node in devMap_, whose MediaDeviceDeps are gone,
/// where udev tells of the node before the media device), and one that starts while nodes appear
/// can miss the last of them for good.
class Manager {
 public:
  /// Throws live::DeviceError where libcamera does not start.
  Manager();
  ~Manager();
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  [[nodiscard]] libcamera::CameraManager& operator*() const noexcept;
};

}  // namespace dtact::hal::libcamera_backend
