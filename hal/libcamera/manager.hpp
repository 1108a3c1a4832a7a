#pragma once

#include <libcamera/camera_manager.h>

namespace dtact::hal::libcamera_backend {

/// This process's camera manager, of which libcamera allows one. It starts with the first of
/// these objects and ends with the last. Cameras must be released before (libcamera's contract for
/// CameraManager::stop()).
///
/// It is kept only while a camera is used. When a camera that a manager has seen disappears and
/// returns, the manager accesses freed memory (seen with 0.0.3:
/// DeviceEnumeratorUdev::addV4L2Device() finds the node in devMap_, whose MediaDeviceDeps are gone,
/// where udev reports the node before the media device). A manager that starts while nodes appear
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
