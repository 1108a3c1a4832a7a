#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/camera.hpp"
#include "hal/config.hpp"

namespace dtact::hal::v4l2 {

/// A control as a device offers it.
struct OfferedControl {
  std::string name;  ///< As v4l2-ctl says it: "exposure_time_absolute".
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  std::int64_t step = 1;
  std::int64_t initial = 0;  ///< The driver's default.
  std::int64_t value = 0;
};

/// The controls of the photometric lock that the device at `fd` has.
[[nodiscard]] std::vector<OfferedControl> list_controls(int fd);

/// A control after it was set, and what its answers are worth. uvcvideo asks a camera for the value
/// of a control once and answers from its own copy from then on, in which a setting is entered too;
/// only controls that the camera itself calls AUTO_UPDATE are asked for every time
/// (__uvc_ctrl_load_cur() and uvc_ctrl_commit_entity() in drivers/media/usb/uvc/uvc_ctrl.c of Linux
/// 6.1). Closing the last handle leaves the copy, UVCIOC_CTRL_QUERY asks extension units alone
/// (uvc_xu_ctrl_query()), and usbfs lets nobody ask an interface that a driver has. So the first
/// question after a plug tells what the camera did, and any later one may not. Automatics,
/// auto_exposure and power_line_frequency are parts of a byte, which the driver reads before it
/// writes (uvc_ctrl_set()), and the value of an automatic it reads when that is set
/// (uvc_ctrl_send_slave_event()): that was the first question then.
struct LockedControl {
  CameraControl control;
  bool asked = false;         ///< The camera itself was asked after the setting.
  bool always_asked = false;  ///< And is asked again with every question.
};

/// The photometric lock: everything that would change the picture by itself is switched off, and
/// what is left is set to the configured value, or to the camera's default so that every start is
/// like the other.
class PhotometricLock {
 public:
  /// Throws std::runtime_error naming the key when a control is not one of the lock's, when two
  /// keys contradict, or when a value is impossible.
  explicit PhotometricLock(const V4l2Config& config);

  /// Sets every control of the device, before it streams, and reads it back. Transfers of
  /// `usb_device` (as of usb_device_of()) tell whether it was the camera that answered. Never
  /// throws for what the camera refuses: the entry's note says it.
  [[nodiscard]] std::vector<LockedControl> apply(int fd,
                                                 const std::filesystem::path& usb_device) const;

  /// Sets every control again, in a stream. What the camera said `before` stands where it isn't
  /// asked again.
  [[nodiscard]] std::vector<CameraControl> apply_again(
      int fd, const std::vector<LockedControl>& before) const;

  /// Reads those of `controls` again that weren't refused, and sets again what has moved. Returns
  /// the sentence that says what moved; empty when nothing did.
  [[nodiscard]] std::string check(int fd, std::vector<CameraControl>& controls) const;

 private:
  V4l2Config config_;
  double exposure_us_ = 0;  // 0 = the camera's default
};

}  // namespace dtact::hal::v4l2
