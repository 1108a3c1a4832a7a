#include "hal/v4l2/stream.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <utility>

#include "hal/base/clock.hpp"
#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/node.hpp"

namespace dtact::hal::v4l2 {
namespace {

using live::DequeueStatus;
using live::FilledBuffer;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::uint32_t kType = V4L2_BUF_TYPE_VIDEO_CAPTURE;

v4l2_buffer buffer_request(std::uint32_t index = 0) {
  v4l2_buffer buffer{};
  buffer.type = kType;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

/// What the driver says of raw luma; where it says nothing, V4L2_MAP_QUANTIZATION_DEFAULT: YCbCr
/// is limited unless it comes from a JPEG. Sensors' GREY is the bare converter value: full.
bool is_full_range(const v4l2_pix_format& pix, const std::string& configured) {
  if (configured != "auto") return configured == "full";
  if (pix.quantization != V4L2_QUANTIZATION_DEFAULT) {
    return pix.quantization == V4L2_QUANTIZATION_FULL_RANGE;
  }
  return pix.colorspace == V4L2_COLORSPACE_JPEG || pix.pixelformat == V4L2_PIX_FMT_GREY;
}

}  // namespace

Stream::Stream(base::UniqueFd fd, const std::string& node, std::uint32_t fourcc,
               const CameraConfig& asked, const PhotometricLock& lock)
    : fd_(std::move(fd)), node_(node), lock_(lock) {
  v4l2_capability driver{};
  if (call(fd_.get(), VIDIOC_QUERYCAP, driver) == 0) {
    uvcvideo_ = std::strcmp(reinterpret_cast<const char*>(driver.driver), "uvcvideo") == 0;
  }
  set_format(fourcc, asked);
  set_rate(fourcc, asked);
  map_buffers();
}

Stream::~Stream() { stop(); }

/// uvcvideo marks its timestamps as start of exposure but takes them on decoding a frame's first
/// packet (uvc_video_decode_start() in drivers/media/usb/uvc/uvc_video.c). Only its parameter
/// hwtimestamps, off by default, derives the start of exposure from the camera's clock, though not
/// for every frame or camera. It does not report which, so this returns the later of the two.
TimestampMeaning Stream::meaning_of(std::uint32_t flags) const noexcept {
  if ((flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) != V4L2_BUF_FLAG_TSTAMP_SRC_SOE) {
    return TimestampMeaning::end_of_frame;
  }
  return uvcvideo_ ? TimestampMeaning::first_packet : TimestampMeaning::start_of_exposure;
}

/// A buffer's time, if its clock is ours and the moment is plausible: uvcvideo's conversion of
/// camera clocks has been seen to give times in the future.
void Stream::set_time(const v4l2_buffer& buffer, FilledBuffer& out) const noexcept {
  const std::int64_t now = base::system_clock().monotonic_ns();
  out.timestamp_ns = now;
  out.meaning = TimestampMeaning::arrival;
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) return;
  const std::int64_t stamp =
      std::int64_t{buffer.timestamp.tv_sec} * kSecond + buffer.timestamp.tv_usec * 1000;
  if (stamp > now || stamp < now - kSecond) return;
  out.timestamp_ns = stamp;
  out.meaning = meaning_of(buffer.flags);
}

void Stream::set_format(std::uint32_t fourcc, const CameraConfig& asked) {
  v4l2_format format{};
  format.type = kType;
  format.fmt.pix.width = static_cast<std::uint32_t>(asked.width);
  format.fmt.pix.height = static_cast<std::uint32_t>(asked.height);
  format.fmt.pix.pixelformat = fourcc;
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (const int e = call(fd_.get(), VIDIOC_S_FMT, format); e != 0) {
    throw error_of(e, "set the mode of", node_);
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  format_.width = static_cast<int>(pix.width);
  format_.height = static_cast<int>(pix.height);
  format_.bytes_per_line = pix.bytesperline;
  format_.full_range = is_full_range(pix, asked.v4l2.range);
  const PixelFormat* known = find_format(pix.pixelformat);
  if (known != nullptr) format_.encoding = known->encoding;
  if (known == nullptr || pix.pixelformat != fourcc || format_.width != asked.width ||
      format_.height != asked.height) {
    // What the driver lists and then doesn't run is no way out; what it runs instead may be one.
    std::vector<Mode> modes = list_modes(fd_.get());
    const auto is = [](std::uint32_t code, int width, int height) {
      return [=](const Mode& m) { return m.fourcc == code && m.has_size(width, height); };
    };
    std::erase_if(modes, is(fourcc, asked.width, asked.height));
    if (std::ranges::none_of(modes, is(pix.pixelformat, format_.width, format_.height))) {
      Mode instead;
      instead.fourcc = pix.pixelformat;
      instead.width = instead.min_width = format_.width;
      instead.height = instead.min_height = format_.height;
      modes.push_back(std::move(instead));
    }
    throw ModeError(
        fmt::format("{} runs {} at {}x{} when asked for {} at {}x{}: set camera.width, "
                    "camera.height and camera.v4l2.pixel_format to one of: {}",
                    node_, fourcc_text(pix.pixelformat), format_.width, format_.height,
                    fourcc_text(fourcc), asked.width, asked.height, alternatives(modes, asked)));
  }
}

void Stream::set_rate(std::uint32_t fourcc, const CameraConfig& asked) {
  v4l2_streamparm parameters{};
  parameters.type = kType;
  // 60.5 fps is 1000/60500 s; drivers take the nearest they have.
  parameters.parm.capture.timeperframe = {1000,
                                          static_cast<std::uint32_t>(std::lround(asked.fps * 1e3))};
  const int error = call(fd_.get(), VIDIOC_S_PARM, parameters);
  // A driver without a choice of rates has no such call.
  if (error == ENOTTY || error == EINVAL) return;
  if (error != 0) throw error_of(error, "set the frame rate of", node_);
  const v4l2_fract& got = parameters.parm.capture.timeperframe;
  const double rate =
      got.numerator == 0 ? asked.fps : double{1.0} * got.denominator / got.numerator;
  if (std::abs(rate - asked.fps) <= 0.5) return;
  // This mode's present report counts, whatever the device has listed.
  std::vector<Mode> modes = list_modes(fd_.get());
  for (Mode& mode : modes) {
    if (mode.fourcc != fourcc || !mode.has_size(asked.width, asked.height)) continue;
    mode.fps = {rate};
    mode.fps_is_range = false;
  }
  throw ModeError(
      fmt::format("{} runs at {:.2f} frames a second when asked for {:g}: set camera.fps, "
                  "camera.width, camera.height and camera.v4l2.pixel_format to one of: {}",
                  node_, rate, asked.fps, alternatives(modes, asked)));
}

void Stream::map_buffers() {
  v4l2_requestbuffers request{};
  request.type = kType;
  request.memory = V4L2_MEMORY_MMAP;
  request.count = kBuffers;
  if (const int e = call(fd_.get(), VIDIOC_REQBUFS, request); e != 0) {
    throw error_of(e, "get buffers of", node_);
  }
  if (request.count < 2) throw error_of(ENOMEM, "get buffers of", node_);
  buffers_.reserve(request.count);
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = buffer_request(i);
    int error = call(fd_.get(), VIDIOC_QUERYBUF, buffer);
    void* memory = MAP_FAILED;
    if (error == 0) {
      memory = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(),
                      static_cast<off_t>(buffer.m.offset));
      error = errno;
    }
    if (memory == MAP_FAILED) {
      stop();
      throw error_of(error, "map buffers of", node_);
    }
    buffers_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
  }
}

void Stream::start() {
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    v4l2_buffer buffer = buffer_request(static_cast<std::uint32_t>(i));
    if (const int e = call(fd_.get(), VIDIOC_QBUF, buffer); e != 0) {
      throw error_of(e, "queue buffers of", node_);
    }
  }
  queued_ = static_cast<int>(buffers_.size());
  std::uint32_t type = kType;
  if (const int e = call(fd_.get(), VIDIOC_STREAMON, type); e != 0) {
    throw error_of(e, "start the stream of", node_);
  }
}

void Stream::stop() noexcept {
  if (!fd_ || buffers_.empty()) return;
  // For a device that is gone each of these fails, and the failure needs no action.
  std::uint32_t type = kType;
  (void)call(fd_.get(), VIDIOC_STREAMOFF, type);
  for (const auto& buffer : buffers_) ::munmap(buffer.data(), buffer.size());
  buffers_.clear();
  v4l2_requestbuffers none{};
  none.type = kType;
  none.memory = V4L2_MEMORY_MMAP;
  (void)call(fd_.get(), VIDIOC_REQBUFS, none);
}

void Stream::wait(std::int64_t deadline_ns) noexcept {
  const std::int64_t left =
      std::max<std::int64_t>(0, deadline_ns - base::system_clock().monotonic_ns());
  const timespec timeout{.tv_sec = left / kSecond, .tv_nsec = left % kSecond};
  pollfd events{.fd = fd_.get(), .events = POLLIN, .revents = 0};
  // Whatever it says, dequeue() finds out what has happened.
  (void)::ppoll(&events, 1, &timeout, nullptr);
}

DequeueStatus Stream::dequeue(FilledBuffer& out) noexcept {
  v4l2_buffer buffer = buffer_request();
  const int error = call(fd_.get(), VIDIOC_DQBUF, buffer);
  if (error == EAGAIN) return DequeueStatus::none;
  // After an unplug drivers answer with ENODEV, EIO or, the queue being gone, EINVAL.
  if (error != 0 || buffer.index >= buffers_.size()) return DequeueStatus::failed;
  --queued_;
  const auto memory = buffers_[buffer.index];
  out.index = static_cast<int>(buffer.index);
  out.payload = memory.first(std::min<std::size_t>(buffer.bytesused, memory.size()));
  out.sequence = buffer.sequence;
  out.flagged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
  set_time(buffer, out);
  return DequeueStatus::filled;
}

bool Stream::enqueue(int index) noexcept {
  v4l2_buffer buffer = buffer_request(static_cast<std::uint32_t>(index));
  const bool taken = call(fd_.get(), VIDIOC_QBUF, buffer) == 0;
  if (taken) ++queued_;
  return taken;
}

void Stream::lock_controls() { controls_ = lock_.apply(fd_.get(), usb_device_of(node_)); }

std::vector<CameraControl> Stream::lock_controls_again() {
  return lock_.apply_again(fd_.get(), controls_);
}

std::string Stream::check_controls(std::vector<CameraControl>& controls) {
  return lock_.check(fd_.get(), controls);
}

void Stream::change(const CameraChange& change, std::vector<CameraControl>& controls,
                    CameraSettings& settings) {
  PhotometricLock::change(fd_.get(), change, controls);
  settings = this->settings(controls);
}

}  // namespace dtact::hal::v4l2
