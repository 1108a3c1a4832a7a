#include "hal/v4l2/modes.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "hal/v4l2/node.hpp"

namespace dtact::hal::v4l2 {
namespace {

/// Rates are stored by drivers as fractions or 100 ns units (60 fps = 60.00024); a mode is another
/// one only when it differs by more.
constexpr double kRateTolerance = 0.5;

/// No driver offers more; a broken one must not make the enumeration endless.
constexpr std::uint32_t kMaxEntries = 256;

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0.0 : double{1.0} * interval.denominator / interval.numerator;
}

void list_rates(int fd, Mode& mode) {
  v4l2_frmivalenum entry{};
  entry.pixel_format = mode.fourcc;
  entry.width = static_cast<std::uint32_t>(mode.width);
  entry.height = static_cast<std::uint32_t>(mode.height);
  for (; entry.index < kMaxEntries; ++entry.index) {
    if (call(fd, VIDIOC_ENUM_FRAMEINTERVALS, entry) != 0) break;
    if (entry.type != V4L2_FRMIVAL_TYPE_DISCRETE) {
      mode.fps = {rate_of(entry.stepwise.min), rate_of(entry.stepwise.max)};
      mode.fps_is_range = true;
      break;
    }
    mode.fps.push_back(rate_of(entry.discrete));
  }
  std::ranges::sort(mode.fps, std::greater<>{});
}

void list_sizes(int fd, std::uint32_t fourcc, std::vector<Mode>& modes) {
  v4l2_frmsizeenum entry{};
  entry.pixel_format = fourcc;
  for (; entry.index < kMaxEntries; ++entry.index) {
    if (call(fd, VIDIOC_ENUM_FRAMESIZES, entry) != 0) return;
    Mode mode;
    mode.fourcc = fourcc;
    if (entry.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      mode.width = mode.min_width = static_cast<int>(entry.discrete.width);
      mode.height = mode.min_height = static_cast<int>(entry.discrete.height);
    } else {
      mode.width = static_cast<int>(entry.stepwise.max_width);
      mode.height = static_cast<int>(entry.stepwise.max_height);
      mode.min_width = static_cast<int>(entry.stepwise.min_width);
      mode.min_height = static_cast<int>(entry.stepwise.min_height);
    }
    list_rates(fd, mode);
    modes.push_back(std::move(mode));
    if (entry.type != V4L2_FRMSIZE_TYPE_DISCRETE) return;
  }
}

}  // namespace

const std::vector<PixelFormat>& supported_formats() {
  static const std::vector<PixelFormat> formats{
      {V4L2_PIX_FMT_GREY, "GREY", "grey", live::Encoding::grey},
      {V4L2_PIX_FMT_NV12, "NV12", "nv12", live::Encoding::nv12},
      {V4L2_PIX_FMT_YUYV, "YUYV", "yuyv", live::Encoding::yuyv},
      {V4L2_PIX_FMT_MJPEG, "MJPEG", "mjpeg", live::Encoding::jpeg}};
  return formats;
}

const PixelFormat* find_format(std::uint32_t fourcc) noexcept {
  // Some drivers say JPEG for the frames of a motion JPEG.
  if (fourcc == V4L2_PIX_FMT_JPEG) fourcc = V4L2_PIX_FMT_MJPEG;
  const auto& formats = supported_formats();
  const auto it = std::ranges::find(formats, fourcc, &PixelFormat::fourcc);
  return it == formats.end() ? nullptr : &*it;
}

void check_pixel_format(const std::string& key) {
  const auto& formats = supported_formats();
  if (key == "auto" || std::ranges::any_of(formats, [&](const auto& f) { return key == f.key; })) {
    return;
  }
  throw std::runtime_error(fmt::format(
      "camera.v4l2.pixel_format = \"{}\": allowed are auto, grey, nv12, yuyv, mjpeg", key));
}

std::string Mode::format_name() const {
  const PixelFormat* format = find_format(fourcc);
  return format != nullptr ? format->name : fourcc_text(fourcc);
}

bool Mode::has_size(int w, int h) const noexcept {
  return w >= min_width && w <= width && h >= min_height && h <= height;
}

bool Mode::offers(int w, int h, double rate) const noexcept {
  if (!has_size(w, h)) return false;
  if (fps.empty()) return true;
  if (fps_is_range) {
    return rate <= fps.front() + kRateTolerance && rate >= fps.back() - kRateTolerance;
  }
  return std::ranges::any_of(fps, [&](double f) { return std::abs(f - rate) <= kRateTolerance; });
}

std::vector<Mode> list_modes(int fd) {
  std::vector<Mode> modes;
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; format.index < kMaxEntries && call(fd, VIDIOC_ENUM_FMT, format) == 0; ++format.index) {
    list_sizes(fd, format.pixelformat, modes);
  }
  return modes;
}

std::uint32_t choose(const std::vector<Mode>& modes, const CameraConfig& asked,
                     const std::string& name) {
  const std::string& key = asked.v4l2.pixel_format;
  for (const PixelFormat& format : supported_formats()) {
    if (key != "auto" && key != format.key) continue;
    if (key == "auto" && asked.decode_scale != 1 && format.encoding != live::Encoding::jpeg)
      continue;
    for (const Mode& mode : modes) {
      if (find_format(mode.fourcc) == &format &&
          mode.offers(asked.width, asked.height, asked.fps)) {
        return mode.fourcc;
      }
    }
  }
  throw ModeError(
      fmt::format("{} has no mode {}x{} at {:g} frames a second{}: set camera.width, "
                  "camera.height, camera.fps and camera.v4l2.pixel_format to one of: {}",
                  name, asked.width, asked.height, asked.fps,
                  key != "auto"             ? " in " + key
                  : asked.decode_scale != 1 ? " in mjpeg, which camera.decode_scale needs"
                                            : "",
                  alternatives(modes, asked)));
}

std::string alternatives(const std::vector<Mode>& modes, const CameraConfig& asked) {
  std::vector<Mode> usable;
  std::ranges::copy_if(modes, std::back_inserter(usable), &Mode::usable);
  std::ranges::stable_partition(
      usable, [&](const Mode& mode) { return mode.has_size(asked.width, asked.height); });
  if (!usable.empty() || modes.empty()) return describe(usable);
  return fmt::format(
      "nothing (it has only {}, which cannot be read; of a bare sensor's raw Bayer "
      "camera.backend = \"libcamera\" makes an image)",
      describe(modes));
}

std::string describe(const std::vector<Mode>& modes) {
  if (modes.empty()) return "nothing (the driver lists no mode)";
  std::string text;
  for (const Mode& mode : modes) {
    if (!text.empty()) text += "; ";
    text += mode.format_name() + " ";
    if (mode.min_width != mode.width)
      text += fmt::format("{}x{}...", mode.min_width, mode.min_height);
    text += fmt::format("{}x{}", mode.width, mode.height);
    for (std::size_t i = 0; i < mode.fps.size(); ++i) {
      text += i == 0 ? " at " : mode.fps_is_range ? "..." : ", ";
      text += fmt::format("{:g}", std::round(mode.fps[i] * 100) / 100);
    }
  }
  return text;
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (unsigned i = 0; i < 4; ++i) text += static_cast<char>(fourcc >> 8U * i & 0x7fU);
  return text;
}

}  // namespace dtact::hal::v4l2
