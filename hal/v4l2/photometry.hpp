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
  std::string name;  ///< the name in v4l2-ctl: "exposure_time_absolute"
  std::int64_t minimum = 0;
  std::int64_t maximum = 0;
  std::int64_t step = 1;
  std::int64_t initial = 0;  ///< The driver's default.
  std::int64_t value = 0;
};

/// The controls of the photometric lock that the device at `fd` has.
[[nodiscard]] std::vector<OfferedControl> list_controls(int fd);

/// A control after it was set, and how reliable its answers are. uvcvideo reads a control's value
/// from the camera once and answers later reads from its own copy, which settings update, too.
/// It reads only controls that the camera itself calls AUTO_UPDATE every time
/// (__uvc_ctrl_load_cur() and uvc_ctrl_commit_entity() in drivers/media/usb/uvc/uvc_ctrl.c of Linux
/// 6.1). Closing the last handle keeps the copy, UVCIOC_CTRL_QUERY reads extension units only
/// (uvc_xu_ctrl_query()), and usbfs has no access to an interface that a driver owns. So the first
/// read after a plug shows the camera's state, and any later one may not. Automatics,
/// auto_exposure and power_line_frequency are parts of a byte, which the driver reads before it
/// writes (uvc_ctrl_set()). It reads the value of an automatic when that is set
/// (uvc_ctrl_send_slave_event()): that was the first read then.
struct LockedControl {
  CameraControl control;
  bool asked = false;         ///< The camera itself was asked after the setting.
  bool always_asked = false;  ///< And is asked again with every question.
};

/// The photometric lock: switches off everything that would change the picture by itself, and sets
/// the rest to the configured values, or to the camera's defaults so that every start is
/// like the others.
class PhotometricLock {
 public:
  /// Throws std::runtime_error naming the key when a control is not one of the lock's, when two
  /// keys contradict, or when a value is impossible.
  explicit PhotometricLock(const V4l2Config& config);

  /// Sets every control of the device, before it streams, and reads it back. Transfers of
  /// `usb_device` (from usb_device_of()) show whether the camera itself answered. Never
  /// throws when the camera refuses a value: the entry's note reports it.
  [[nodiscard]] std::vector<LockedControl> apply(int fd,
                                                 const std::filesystem::path& usb_device) const;

  /// Sets every control again, in a stream. What the camera said `before` stands where it isn't
  /// asked again.
  [[nodiscard]] std::vector<CameraControl> apply_again(
      int fd, const std::vector<LockedControl>& before) const;

  /// Reads those of `controls` again that weren't refused, and sets again what has moved. Returns
  /// the sentence that says what moved; empty when nothing did.
  [[nodiscard]] std::string check(int fd, std::vector<CameraControl>& controls) const;

  /// Exposure and gain of the device at `fd`, as far as it has them.
  [[nodiscard]] static CameraSettings settings(int fd, const std::vector<CameraControl>& controls);
  /// Sets what `change` has to the nearest values of the controls, and its entries of `controls`.
  /// When the camera refuses one, sets all back and throws std::runtime_error.
  static void change(int fd, const CameraChange& change, std::vector<CameraControl>& controls);

 private:
  V4l2Config config_;
  double exposure_us_ = 0;  // 0 = the camera's default
};

}  // namespace dtact::hal::v4l2
