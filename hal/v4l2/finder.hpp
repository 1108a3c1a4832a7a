#pragma once

#include <string>
#include <vector>

#include "hal/base/unique_fd.hpp"

namespace dtact::hal::v4l2 {

/// A capture node of an attached camera, or a node that could not be opened to find out.
struct Attached {
  std::string node;     ///< "/dev/video0": may change at every plug.
  std::string by_path;  ///< Link below /dev/v4l/by-path; empty where udev made none.
  std::string by_id;    ///< Link below /dev/v4l/by-id; empty where udev made none.
  std::string serial;   ///< Of the USB device; empty when it has none.
  std::string bus;      ///< The driver's bus_info: "usb-0000:00:14.0-2".
  std::string card;     ///< The camera's own name.
  std::string driver;
  std::string problem;  ///< Why the node could not be opened, with the remedy; else empty.

  /// The name to configure: by-path, or what else there is.
  [[nodiscard]] std::string stable_name() const;
};

/// The cameras that are attached, in the order of their stable names. Metadata nodes and nodes that
/// capture nothing are left out.
[[nodiscard]] std::vector<Attached> list_attached();

/// Which camera is meant, parsed from `camera.v4l2.device`.
class DeviceName {
 public:
  /// Throws std::runtime_error naming `camera.v4l2.device` and the allowed forms.
  explicit DeviceName(const std::string& text);

  /// The node, opened non-blocking, of the camera that the name means now. Throws DeviceError:
  /// unplugged (naming what is attached instead), denied, or, when the name means none or several
  /// cameras, unplugged with the names to choose from. Never a metadata node.
  struct Opened {
    base::UniqueFd fd;
    std::string node;
    std::string identity;  ///< As configured, or the stable name of the only camera.
  };
  [[nodiscard]] Opened open() const;
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  enum class Kind : unsigned char { only, path, serial, bus };
  [[nodiscard]] bool means(const Attached& camera) const;

  std::string text_;
  Kind kind_ = Kind::only;
  std::string value_;
};

}  // namespace dtact::hal::v4l2
