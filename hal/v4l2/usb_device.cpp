#include "hal/v4l2/usb_device.hpp"

#include <fstream>
#include <system_error>

namespace dtact::hal::v4l2 {

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
