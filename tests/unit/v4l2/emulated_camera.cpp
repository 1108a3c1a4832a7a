#include "tests/unit/v4l2/emulated_camera.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <stdexcept>

#include "hal/base/unique_fd.hpp"
#include "tests/unit/v4l2/ioctl_argument.hpp"

namespace dtact::hal::v4l2 {
namespace {

// A video node declared as a plain file ("=00"), which can be mapped, unlike umockdev's terminals.
constexpr const char* kDevices =
    "P: /devices/usb/1-1/1-1:1.0/video4linux/video0\n"
    "N: video0=00\n"
    "E: DEVNAME=/dev/video0\n"
    "E: SUBSYSTEM=video4linux\n"
    "A: dev=81:0\\n\n"
    "L: device=../../../1-1:1.0\n"
    "\n"
    "P: /devices/usb/1-1/1-1:1.0\n"
    "E: SUBSYSTEM=usb\n"
    "\n"
    "P: /devices/usb/1-1\n"
    "E: SUBSYSTEM=usb\n"
    "A: serial=4711\\n\n"
    "A: idVendor=1d6b\\n\n"
    "A: urbnum=7\\n\n"
    "\n"
    "P: /devices/usb\n"
    "E: SUBSYSTEM=usb\n"
    "A: serial=0000:00:14.0\\n\n"
    "A: idVendor=1d6b\\n\n";

constexpr std::uint32_t kMaxBuffers = 8;

}  // namespace

EmulatedCamera::EmulatedCamera()
    : testbed_(umockdev_testbed_new()), handler_(umockdev_ioctl_base_new()) {
  controls_[V4L2_CID_EXPOSURE_AUTO] = {"Auto Exposure", 0, 3, 3, 3};
  controls_[V4L2_CID_EXPOSURE_AUTO_PRIORITY] = {"Exposure, Dynamic Framerate", 0, 1, 1, 1};
  controls_[V4L2_CID_POWER_LINE_FREQUENCY] = {"Power Line Frequency", 0, 2, 2, 2};
  controls_[V4L2_CID_EXPOSURE_ABSOLUTE] = {"Exposure Time", 1, 1000, 156, 156};
  controls_[V4L2_CID_GAIN] = {"Gain", 0, 100, 5, 60};
  GError* error = nullptr;
  umockdev_testbed_add_from_string(testbed_, kDevices, &error);
  if (error != nullptr) throw std::runtime_error(error->message);
  g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&EmulatedCamera::on_ioctl), this);
  umockdev_testbed_attach_ioctl(testbed_, "/dev/video0", handler_, &error);
  if (error != nullptr) throw std::runtime_error(error->message);
  gchar* root = umockdev_testbed_get_root_dir(testbed_);
  root_ = root;
  backing_ = root_ + "/dev/video0";
  g_free(root);
  if (::truncate(backing_.c_str(), static_cast<off_t>(buffer_bytes()) * kMaxBuffers) != 0) {
    throw std::runtime_error("no backing file");
  }
}

EmulatedCamera::~EmulatedCamera() {
  umockdev_testbed_detach_ioctl(testbed_, "/dev/video0", nullptr);
  g_object_unref(handler_);
  g_object_unref(testbed_);
}

// Buffers begin at whole pages, since they are mapped one by one. A page has room for 32×16
// pixels in every format.
std::uint32_t EmulatedCamera::buffer_bytes() const {
  return static_cast<std::uint32_t>(::sysconf(_SC_PAGESIZE));
}

void EmulatedCamera::fail(unsigned long request, int error, int times) {
  const std::lock_guard guard(mutex_);
  failures_[request] = {error, times};
}

void EmulatedCamera::deliver(const EmulatedBuffer& buffer) {
  const std::lock_guard guard(mutex_);
  pending_.push_back(buffer);
}

void EmulatedCamera::deliver_grey(std::uint8_t value, std::uint32_t sequence) {
  EmulatedBuffer buffer;
  buffer.payload.assign(std::size_t{kWidth} * kHeight, value);
  buffer.sequence = sequence;
  deliver(buffer);
}

void EmulatedCamera::set_driver(const std::string& name) {
  const std::lock_guard guard(mutex_);
  driver_ = name;
}

void EmulatedCamera::set_pixel_format(std::uint32_t fourcc) {
  const std::lock_guard guard(mutex_);
  fourcc_ = fourcc;
}

void EmulatedCamera::insist_on_width(std::uint32_t width) {
  const std::lock_guard guard(mutex_);
  forced_width_ = width;
}

void EmulatedCamera::insist_on_rate(std::uint32_t fps) {
  const std::lock_guard guard(mutex_);
  forced_fps_ = fps;
}

void EmulatedCamera::forget_serial() const {
  ::unlink((root_ + "/sys/devices/usb/1-1/serial").c_str());
}

void EmulatedCamera::grant_buffers(std::uint32_t count) {
  const std::lock_guard guard(mutex_);
  granted_ = count;
}

void EmulatedCamera::set_control(std::uint32_t id, std::int32_t value) {
  const std::lock_guard guard(mutex_);
  controls_.at(id).value = value;
}

void EmulatedCamera::answer_from_a_copy(std::uint32_t id) {
  const std::lock_guard guard(mutex_);
  controls_.at(id).copied = true;
}

void EmulatedCamera::ignore(std::uint32_t id) {
  const std::lock_guard guard(mutex_);
  controls_.at(id).ignored = true;
}

void EmulatedCamera::refuse(std::uint32_t id) {
  const std::lock_guard guard(mutex_);
  controls_.at(id).refused = true;
}

void EmulatedCamera::set_step(std::uint32_t id, std::int32_t step) {
  const std::lock_guard guard(mutex_);
  controls_.at(id).step = step;
}

void EmulatedCamera::count_transfer() const {
  const std::string path = root_ + "/sys/devices/usb/1-1/urbnum";
  std::uint64_t count = 0;
  std::ifstream(path) >> count;
  std::ofstream(path) << count + 1 << '\n';
}

std::int32_t EmulatedCamera::control(std::uint32_t id) const {
  const std::lock_guard guard(mutex_);
  return controls_.at(id).value;
}

bool EmulatedCamera::streaming() const {
  const std::lock_guard guard(mutex_);
  return streaming_;
}

gboolean EmulatedCamera::on_ioctl(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                  gpointer self) {
  static_cast<EmulatedCamera*>(self)->handle(client);
  return TRUE;
}

void EmulatedCamera::handle(UMockdevIoctlClient* client) {
  const std::lock_guard guard(mutex_);
  const unsigned long request = umockdev_ioctl_client_get_request(client);
  if (const auto it = failures_.find(request); it != failures_.end() && it->second.second != 0) {
    auto& [error, times] = it->second;
    if (times > 0) --times;
    if (error != 0) {
      umockdev_ioctl_client_complete(client, -1, error);
      return;
    }
  }
  UMockdevIoctlData* pointer = umockdev_ioctl_client_get_arg(client);
  const std::size_t size = _IOC_SIZE(request);
  UMockdevIoctlData* data = umockdev_ioctl_data_resolve(pointer, 0, size, nullptr);
  std::vector<std::uint8_t> argument(data->data, data->data + size);
  const int error = answer(request, argument);
  if (error == 0) umockdev_ioctl_data_update(data, 0, argument.data(), static_cast<gint>(size));
  umockdev_ioctl_data_unref(data);
  umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
}

int EmulatedCamera::answer(unsigned long request, std::vector<std::uint8_t>& argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& capability = as<v4l2_capability>(argument);
      put_text(capability.driver, driver_);
      put_text(capability.card, "Emulated camera");
      put_text(capability.bus_info, "usb-emulated-1");
      capability.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      capability.capabilities = capability.device_caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto& format = as<v4l2_fmtdesc>(argument);
      format.pixelformat = fourcc_;
      return format.index == 0 ? 0 : EINVAL;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto& size = as<v4l2_frmsizeenum>(argument);
      size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
      size.discrete = {kWidth, kHeight};
      return size.index == 0 ? 0 : EINVAL;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
      auto& interval = as<v4l2_frmivalenum>(argument);
      interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
      interval.discrete = {1, 60};
      return interval.index == 0 ? 0 : EINVAL;
    }
    case VIDIOC_S_FMT: {
      auto& pix = as<v4l2_format>(argument).fmt.pix;
      if (forced_width_ != 0) pix.width = forced_width_;
      pix.bytesperline = fourcc_ == V4L2_PIX_FMT_MJPEG  ? 0
                         : fourcc_ == V4L2_PIX_FMT_YUYV ? 2 * pix.width
                                                        : pix.width;
      return 0;
    }
    case VIDIOC_S_PARM:
      if (forced_fps_ != 0) {
        as<v4l2_streamparm>(argument).parm.capture.timeperframe = {1, forced_fps_};
      }
      return 0;
    case VIDIOC_REQBUFS: {
      auto& buffers = as<v4l2_requestbuffers>(argument);
      buffers.count = std::min(buffers.count, granted_);
      queued_.clear();
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto& buffer = as<v4l2_buffer>(argument);
      buffer.length = buffer_bytes();
      buffer.m.offset = buffer.index * buffer_bytes();
      return 0;
    }
    case VIDIOC_QBUF:
      queued_.push_back(as<v4l2_buffer>(argument).index);
      return 0;
    case VIDIOC_DQBUF:
      return dequeue(as<v4l2_buffer>(argument));
    case VIDIOC_STREAMON:
      streaming_ = true;
      return 0;
    case VIDIOC_STREAMOFF:
      streaming_ = false;
      queued_.clear();
      return 0;
    case VIDIOC_QUERYCTRL: {
      auto& query = as<v4l2_queryctrl>(argument);
      const auto it = controls_.find(query.id);
      if (it == controls_.end()) return EINVAL;
      query.minimum = it->second.minimum;
      query.maximum = it->second.maximum;
      query.step = it->second.step;
      query.default_value = it->second.initial;
      return 0;
    }
    case VIDIOC_G_CTRL: {
      auto& control = as<v4l2_control>(argument);
      Control& known = controls_.at(control.id);
      const bool asked = !known.copied || !known.copy;
      if (asked) known.copy = known.value;
      if (asked || streaming_) count_transfer();  // a stream always has transfers under way
      control.value = *known.copy;
      return 0;
    }
    case VIDIOC_S_CTRL: {
      auto& control = as<v4l2_control>(argument);
      Control& known = controls_.at(control.id);
      count_transfer();
      if (known.refused) return EIO;
      // ROUND_TO_RANGE() in drivers/media/v4l2-core/v4l2-ctrls-core.c.
      control.value = std::clamp(control.value + known.step / 2, known.minimum, known.maximum);
      control.value -= (control.value - known.minimum) % known.step;
      if (!known.ignored) known.value = control.value;
      if (known.copy) known.copy = control.value;
      return 0;
    }
    default:
      return ENOTTY;
  }
}

int EmulatedCamera::dequeue(v4l2_buffer& buffer) {
  if (!streaming_) return EINVAL;
  if (pending_.empty() || queued_.empty()) return EAGAIN;
  const EmulatedBuffer filled = pending_.front();
  pending_.pop_front();
  buffer.index = queued_.front();
  queued_.pop_front();
  const base::UniqueFd file(::open(backing_.c_str(), O_RDWR | O_CLOEXEC));
  if (::pwrite(file.get(), filled.payload.data(), filled.payload.size(),
               static_cast<off_t>(buffer.index) * buffer_bytes()) < 0) {
    return EIO;
  }
  buffer.index += filled.index_offset;
  buffer.bytesused = static_cast<std::uint32_t>(filled.payload.size());
  buffer.flags = filled.flags;
  buffer.sequence = filled.sequence;
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  const std::int64_t us = filled.timestamp_us >= 0
                              ? filled.timestamp_us
                              : now.tv_sec * std::int64_t{1'000'000} + now.tv_nsec / 1000;
  buffer.timestamp.tv_sec = us / 1'000'000;
  buffer.timestamp.tv_usec = us % 1'000'000;
  return 0;
}

}  // namespace dtact::hal::v4l2
