#include "hal/v4l2/finder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "hal/v4l2/error_of.hpp"
#include "hal/v4l2/ioctl.hpp"

namespace dtact::hal::v4l2 {
namespace {

namespace fs = std::filesystem;

constexpr const char* kClassFolder = "/sys/class/video4linux";
constexpr const char* kByPath = "/dev/v4l/by-path";
constexpr const char* kById = "/dev/v4l/by-id";
constexpr const char* kForms =
    "allowed are a path below /dev, \"serial:NUMBER\", \"bus:NAME\", or nothing for the only "
    "camera "
    "attached (dtactctl cameras lists them)";

std::vector<fs::path> entries(const char* folder) {
  std::vector<fs::path> paths;
  std::error_code error;  // no such folder: no entries
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    paths.push_back(it->path());
  }
  // video2 before video10.
  std::ranges::sort(paths, {},
                    [](const fs::path& p) { return std::pair(p.native().size(), p.native()); });
  return paths;
}

/// The link in `folder` that leads to the node, or nothing. Several: the shortest.
std::string link_to(const std::string& node, const char* folder) {
  for (const fs::path& link : entries(folder)) {
    std::error_code error;
    if (fs::canonical(link, error) == node && !error) return link;
  }
  return {};
}

/// The nearest "serial" among the parents of the node's device, as the kernel read it from USB.
std::string serial_of(const std::string& node) {
  std::error_code error;
  fs::path device =
      fs::canonical(fs::path(kClassFolder) / fs::path(node).filename() / "device", error);
  while (!error && device.has_relative_path()) {
    std::ifstream file(device / "serial");
    std::string serial;
    if (std::getline(file, serial)) return serial;
    // A host controller has a serial too: its own.
    if (fs::exists(device / "idVendor")) return {};
    device = device.parent_path();
  }
  return {};
}

bool captures(const v4l2_capability& capability) {
  const std::uint32_t caps = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0
                                 ? capability.device_caps
                                 : capability.capabilities;
  return (caps & V4L2_CAP_VIDEO_CAPTURE) != 0 && (caps & V4L2_CAP_STREAMING) != 0;
}

std::string text_of(const __u8* characters, std::size_t size) {
  const auto* begin = reinterpret_cast<const char*>(characters);
  return {begin, std::find(begin, begin + size, '\0')};
}

base::UniqueFd open_node(const std::string& node) {
  return base::UniqueFd(::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
}

std::string names_of(const std::vector<Attached>& cameras) {
  if (cameras.empty()) return "no camera is attached";
  std::string text = "attached: ";
  for (const Attached& camera : cameras) {
    if (&camera != &cameras.front()) text += ", ";
    text += camera.stable_name();
    if (!camera.serial.empty()) text += fmt::format(" (serial:{})", camera.serial);
  }
  return text;
}

}  // namespace

std::string Attached::stable_name() const {
  if (!by_path.empty()) return by_path;
  if (!bus.empty()) return "bus:" + bus;
  return node;
}

std::vector<Attached> list_attached() {
  std::vector<Attached> cameras;
  for (const fs::path& entry : entries(kClassFolder)) {
    if (!entry.filename().native().starts_with("video")) continue;
    Attached camera;
    camera.node = "/dev/" + entry.filename().string();
    const base::UniqueFd fd = open_node(camera.node);
    if (!fd) {
      const int error = errno;
      if (error == ENOENT || error == ENODEV || error == ENXIO) continue;  // just unplugged
      camera.problem = error_of(error, "open", camera.node).what();
    } else {
      v4l2_capability capability{};
      if (call(fd.get(), VIDIOC_QUERYCAP, capability) != 0 || !captures(capability)) continue;
      camera.bus = text_of(capability.bus_info, sizeof capability.bus_info);
      camera.card = text_of(capability.card, sizeof capability.card);
      camera.driver = text_of(capability.driver, sizeof capability.driver);
    }
    camera.by_path = link_to(camera.node, kByPath);
    camera.by_id = link_to(camera.node, kById);
    camera.serial = serial_of(camera.node);
    cameras.push_back(std::move(camera));
  }
  // Not by node: which of two cameras got the first number is a matter of chance.
  std::ranges::sort(cameras, {}, [](const Attached& c) { return c.stable_name() + c.node; });
  return cameras;
}

DeviceName::DeviceName(const std::string& text) : text_(text) {
  if (text.empty()) {
    kind_ = Kind::only;
  } else if (text.starts_with("/dev/")) {
    kind_ = Kind::path;
    value_ = text;
  } else if (text.starts_with("serial:") && text.size() > 7) {
    kind_ = Kind::serial;
    value_ = text.substr(7);
  } else if (text.starts_with("bus:") && text.size() > 4) {
    kind_ = Kind::bus;
    value_ = text.substr(4);
  } else {
    throw std::runtime_error(fmt::format("camera.v4l2.device = \"{}\": {}", text, kForms));
  }
}

bool DeviceName::means(const Attached& camera) const {
  switch (kind_) {
    case Kind::serial:
      return camera.serial == value_;
    case Kind::bus:
      return camera.bus == value_;
    default:
      return true;
  }
}

DeviceName::Opened DeviceName::open() const {
  Opened opened;
  if (kind_ == Kind::path) {
    std::error_code error;
    opened.node = fs::canonical(value_, error);
    if (error) {
      // Tried many times a second: other cameras are not opened for the sentence's sake.
      throw DeviceError(CameraState::unplugged,
                        fmt::format("{} is not there: plug the camera in, or set "
                                    "camera.v4l2.device to one that dtactctl cameras lists",
                                    value_));
    }
    opened.identity = value_;
  } else {
    std::vector<Attached> cameras = list_attached();
    const std::string names = names_of(cameras);
    std::erase_if(cameras, [&](const Attached& c) { return !means(c); });
    if (cameras.empty()) {
      throw DeviceError(CameraState::unplugged,
                        kind_ == Kind::only
                            ? "no camera is attached: plug it in"
                            : fmt::format("no camera {} is attached: plug it in, or set "
                                          "camera.v4l2.device ({})",
                                          text_, names));
    }
    // Of a camera with several nodes the one that can be opened, which has been seen to capture.
    std::ranges::stable_partition(cameras, [](const Attached& c) { return c.problem.empty(); });
    if (cameras.size() > 1 && cameras[1].problem.empty()) {
      throw DeviceError(CameraState::unplugged,
                        fmt::format("several cameras are attached and camera.v4l2.device = \"{}\" "
                                    "doesn't say which: set it to one of them ({})",
                                    text_, names));
    }
    if (!cameras.front().problem.empty()) {
      throw DeviceError(CameraState::denied, cameras.front().problem);
    }
    opened.node = cameras.front().node;
    opened.identity = text_.empty() ? cameras.front().stable_name() : text_;
  }

  opened.fd = open_node(opened.node);
  if (!opened.fd) throw error_of(errno, "open", opened.node);
  v4l2_capability capability{};
  if (const int e = call(opened.fd.get(), VIDIOC_QUERYCAP, capability); e != 0) {
    throw error_of(e, "query", opened.node);
  }
  if (!captures(capability)) {
    throw ModeError(
        fmt::format("{} ({}) is not a capture node (a USB camera has a second node for "
                    "metadata): set camera.v4l2.device to another ({})",
                    value_, opened.node, names_of(list_attached())));
  }
  return opened;
}

}  // namespace dtact::hal::v4l2
