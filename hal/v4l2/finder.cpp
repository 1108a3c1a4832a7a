#include "hal/v4l2/finder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/node.hpp"

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
    // udev makes a link as ".#NAME" and random digits and renames it (systemd, tempfn_random()).
    if (link.filename().native().starts_with('.')) continue;
    std::error_code error;
    if (fs::canonical(link, error) == node && !error) return link;
  }
  return {};
}

/// The USB device's serial number, as read by the kernel.
std::string serial_of(const fs::path& usb_device) {
  std::ifstream file(usb_device / "serial");
  std::string serial;
  std::getline(file, serial);
  return serial;
}

std::uint32_t caps_of(const v4l2_capability& capability) {
  return (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                               : capability.capabilities;
}

bool captures(std::uint32_t caps) {
  return (caps & V4L2_CAP_VIDEO_CAPTURE) != 0 && (caps & V4L2_CAP_STREAMING) != 0;
}

/// "The video input ioctls must be supported by all video capture devices", says
/// Documentation/userspace-api/media/v4l/dev-capture.rst. The capture nodes of scalers have none:
/// bcm2835-isp registers four on a Pi 4 (bcm2835-v4l2-isp.c in raspberrypi/linux, whose ioctls lack
/// vidioc_enum_input), and they say that they deliver YUYV at every size.
bool has_input(int fd) {
  v4l2_input input{};
  return call(fd, VIDIOC_ENUMINPUT, input) == 0;
}

/// Why the node is no camera that can be read as it is; empty when it is one.
std::string why_no_camera(int fd, std::uint32_t caps, bool usb) {
  if ((caps & (V4L2_CAP_VIDEO_M2M | V4L2_CAP_VIDEO_M2M_MPLANE)) != 0) {
    return "it converts images, as a codec does";
  }
  if (!captures(caps)) {
    if ((caps & V4L2_CAP_META_CAPTURE) != 0) return "it delivers metadata, not images";
    if ((caps & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0) {
      return "it has only multi-planar buffers: use camera.backend = \"libcamera\"";
    }
    return "it delivers no images";
  }
  if (usb) return {};
  if ((caps & V4L2_CAP_IO_MC) != 0) {
    return "its pipeline has to be set up first: use camera.backend = \"libcamera\"";
  }
  if (!has_input(fd)) return "it has no video input: it converts what a program hands to it";
  return {};
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

/// Not by node: which of two cameras got the first number is a matter of chance.
std::string order_of(const Attached& camera) { return camera.stable_name() + camera.node; }

/// The nodes on USB, or the others. The two are looked at apart, since opening costs: a codec's
/// (bcm2835-codec) starts a component of the firmware.
std::vector<Attached> look_at(bool usb) {
  std::vector<Attached> nodes;
  for (const fs::path& entry : entries(kClassFolder)) {
    if (!entry.filename().native().starts_with("video")) continue;
    Attached found;
    found.node = "/dev/" + entry.filename().string();
    const fs::path usb_device = usb_device_of(found.node);
    found.usb = !usb_device.empty();
    if (found.usb != usb) continue;
    const base::UniqueFd fd = open_node(found.node);
    if (!fd) {
      const int error = errno;
      if (error == ENOENT || error == ENODEV || error == ENXIO) continue;  // just unplugged
      found.problem = error_of(error, "open", found.node).what();
    } else {
      v4l2_capability capability{};
      if (call(fd.get(), VIDIOC_QUERYCAP, capability) != 0) continue;
      found.bus = text_of(capability.bus_info, sizeof capability.bus_info);
      found.card = text_of(capability.card, sizeof capability.card);
      found.driver = text_of(capability.driver, sizeof capability.driver);
      found.not_taken = why_no_camera(fd.get(), caps_of(capability), usb);
    }
    found.by_path = link_to(found.node, kByPath);
    found.by_id = link_to(found.node, kById);
    if (usb) found.serial = serial_of(usb_device);
    nodes.push_back(std::move(found));
  }
  return nodes;
}

void keep_cameras(std::vector<Attached>& nodes) {
  std::erase_if(nodes, [](const Attached& n) { return !n.not_taken.empty(); });
  std::ranges::sort(nodes, {}, order_of);
}

/// Says of the cameras among `others` that cannot deliver a readable format at the size, why they
/// are not taken. 0×0: any size will do.
void require_format(std::vector<Attached>& others, int width, int height) {
  for (Attached& other : others) {
    if (!other.not_taken.empty() || !other.problem.empty()) continue;
    const base::UniqueFd fd = open_node(other.node);
    const std::vector<Mode> modes = fd ? list_modes(fd.get()) : std::vector<Mode>{};
    if (std::ranges::any_of(modes, [&](const Mode& mode) {
          return mode.usable() && (width == 0 || mode.has_size(width, height));
        })) {
      continue;
    }
    other.not_taken =
        width == 0 ? "it delivers no format that can be read (GREY, NV12, YUYV, MJPEG)"
                   : fmt::format("it delivers no format that can be read at {}x{}", width, height);
  }
}

/// What no name chooses from.
std::vector<Attached> candidates(int width, int height) {
  std::vector<Attached> cameras = look_at(true);
  keep_cameras(cameras);
  if (!cameras.empty()) return cameras;
  cameras = look_at(false);
  require_format(cameras, width, height);
  keep_cameras(cameras);
  return cameras;
}

}  // namespace

std::string Attached::stable_name() const {
  if (!by_path.empty()) return by_path;
  if (!bus.empty()) return "bus:" + bus;
  return node;
}

std::vector<Attached> list_attached() {
  std::vector<Attached> cameras = look_at(true);
  std::ranges::move(look_at(false), std::back_inserter(cameras));
  keep_cameras(cameras);
  return cameras;
}

std::vector<Attached> list_nodes() {
  std::vector<Attached> nodes = look_at(true);
  const bool any_usb =
      std::ranges::any_of(nodes, [](const Attached& n) { return n.not_taken.empty(); });
  std::vector<Attached> others = look_at(false);
  require_format(others, 0, 0);
  for (Attached& other : others) {
    if (any_usb && other.not_taken.empty()) {
      other.not_taken = fmt::format(
          "it is not on USB, and a USB camera is there: set camera.v4l2.device = \"{}\" to take it",
          other.stable_name());
    }
    nodes.push_back(std::move(other));
  }
  const auto rest =
      std::ranges::stable_partition(nodes, [](const Attached& n) { return n.not_taken.empty(); });
  std::ranges::sort(nodes.begin(), rest.begin(), {}, order_of);
  return nodes;
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

DeviceName::Opened DeviceName::open(int width, int height) const {
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
    std::vector<Attached> cameras =
        kind_ == Kind::only ? candidates(width, height) : list_attached();
    const std::string names = names_of(cameras);
    std::erase_if(cameras, [&](const Attached& c) { return !means(c); });
    if (cameras.empty()) {
      throw DeviceError(CameraState::unplugged,
                        kind_ == Kind::only
                            ? "no camera is attached: plug it in (dtactctl cameras says why other "
                              "video nodes are not taken)"
                            : fmt::format("no camera {} is attached: plug it in, or set "
                                          "camera.v4l2.device ({})",
                                          text_, names));
    }
    // Among several nodes of a camera prefers one that can be opened: it has been seen to capture.
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
  if (!captures(caps_of(capability))) {
    throw ModeError(
        fmt::format("{} ({}) is not a capture node (a USB camera has a second node for "
                    "metadata): set camera.v4l2.device to another ({})",
                    value_, opened.node, names_of(list_attached())));
  }
  return opened;
}

}  // namespace dtact::hal::v4l2
