#include "hal/v4l2/node.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "hal/base/device_allow.hpp"

namespace dtact::hal::v4l2 {

DeviceError error_of(int error, const std::string& what, const std::string& node) {
  switch (error) {
    case EBUSY:
      return {CameraState::busy,
              fmt::format("another program uses {}: end it (fuser -v {} names it)", node, node)};
    case ENOSPC:
      return {CameraState::busy,
              fmt::format("the USB bus of {} has no bandwidth left: plug the camera into another "
                          "controller, or choose the pixel format mjpeg or a lower rate",
                          node)};
    case EPERM:
      return {CameraState::denied,
              fmt::format("no permission to open {}: {}", node, base::kDeviceAllowFix)};
    case EACCES:
      return {CameraState::denied,
              fmt::format("no permission to open {}: add the daemon's user to the group video "
                          "(usermod -aG video USER) and start it again",
                          node)};
    default:
      return {CameraState::unplugged, fmt::format("cannot {} {} ({}): plug the camera in again",
                                                  what, node, std::strerror(error))};
  }
}

namespace fs = std::filesystem;

fs::path usb_device_of(const std::string& node) {
  std::error_code error;
  fs::path device =
      fs::canonical("/sys/class/video4linux" / fs::path(node).filename() / "device", error);
  // The node's parent is an interface of the device; hubs and the host controller come after it.
  while (!error && device.has_relative_path()) {
    if (fs::exists(device / "idVendor", error)) return device;
    device = device.parent_path();
  }
  return {};
}

std::optional<std::uint64_t> transfers_of(const fs::path& usb_device) {
  std::ifstream file(usb_device / "urbnum");
  std::uint64_t count = 0;
  if (usb_device.empty() || !(file >> count)) return std::nullopt;
  return count;
}

}  // namespace dtact::hal::v4l2
