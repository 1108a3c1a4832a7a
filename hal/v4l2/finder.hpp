#pragma once

#include <string>
#include <vector>

#include "hal/base/unique_fd.hpp"

namespace dtact::hal::v4l2 {

/// A video node: a camera's, one that is no camera, or one that could not be opened to find out.
struct Attached {
  std::string node;     ///< "/dev/video0": may change at every plug.
  std::string by_path;  ///< Link below /dev/v4l/by-path; empty where udev made none.
  std::string by_id;    ///< Link below /dev/v4l/by-id; empty where udev made none.
  std::string serial;   ///< the USB device's; empty when it has none
  std::string bus;      ///< The driver's bus_info: "usb-0000:00:14.0-2".
  std::string card;     ///< The camera's own name.
  std::string driver;
  bool usb = false;
  std::string problem;    ///< Why the node could not be opened, with the fix; else empty.
  std::string not_taken;  ///< Why it is not the camera that no name means; else empty.

  /// The name to configure: by-path, or what else there is.
  [[nodiscard]] std::string stable_name() const;
};

/// The cameras that are attached, in the order of their stable names. Nodes of metadata, codecs,
/// scalers and pipelines are left out.
[[nodiscard]] std::vector<Attached> list_attached();

/// Every video node: those that `camera.v4l2.device = ""` chooses from, in the order of their
/// stable names, and then the rest with the reason in `not_taken`.
[[nodiscard]] std::vector<Attached> list_nodes();

/// Which camera is meant, parsed from `camera.v4l2.device`.
class DeviceName {
 public:
  /// Throws std::runtime_error naming `camera.v4l2.device` and the allowed forms.
  explicit DeviceName(const std::string& text);

  /// The node, opened non-blocking, of the camera that the name means now. No name means the only
  /// USB camera. Without one it means the only other node that delivers a format of
  /// supported_formats() at `width` × `height` pixels (0: at any). Throws DeviceError: unplugged
  /// (naming what is attached instead), denied, or, when the name matches none or several cameras,
  /// unplugged with the names to choose from. Never a metadata node.
  struct Opened {
    base::UniqueFd fd;
    std::string node;
    std::string identity;  ///< as configured, or the stable name of the only camera
  };
  [[nodiscard]] Opened open(int width = 0, int height = 0) const;
  [[nodiscard]] bool is_path() const noexcept { return kind_ == Kind::path; }
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  enum class Kind : unsigned char { only, path, serial, bus };
  [[nodiscard]] bool means(const Attached& camera) const;

  std::string text_;
  Kind kind_ = Kind::only;
  std::string value_;
};

}  // namespace dtact::hal::v4l2
