#include "hal/libcamera/formats.hpp"

#include <fmt/format.h>
#include <libcamera/formats.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "hal/live/device_error.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

struct Known {
  const lc::PixelFormat& format;
  const char* key;
  Choice choice;
};

/// In the order of preference of "auto": luma as it is first, lossy compression last.
const std::array<Known, 5>& known_formats() {
  static const std::array<Known, 5> formats{{
      {lc::formats::R8, "grey", {"GREY", live::Encoding::grey}},
      {lc::formats::NV12, "nv12", {"NV12", live::Encoding::grey}},
      {lc::formats::YUV420, "yuv420", {"YUV420", live::Encoding::grey}},
      {lc::formats::YUYV, "yuyv", {"YUYV", live::Encoding::yuyv}},
      {lc::formats::MJPEG, "mjpeg", {"MJPEG", live::Encoding::jpeg}},
  }};
  return formats;
}

const Known* find(const lc::PixelFormat& format) {
  const auto& formats = known_formats();
  const auto* it =
      std::ranges::find_if(formats, [&](const Known& k) { return k.format == format; });
  return it == formats.end() ? nullptr : it;
}

std::string describe(const lc::StreamFormats& formats) {
  std::string text;
  for (const lc::PixelFormat& format : formats.pixelformats()) {
    const Known* known = find(format);
    text += fmt::format("{}{}", text.empty() ? "" : "; ",
                        known != nullptr ? known->choice.name : format.toString());
    const std::vector<lc::Size> sizes = formats.sizes(format);
    for (const lc::Size& size : sizes) text += fmt::format(" {}", size.toString());
    if (sizes.empty()) text += " " + formats.range(format).toString();
  }
  return text.empty() ? "nothing that it lists" : text;
}

}  // namespace

Choice choose_format(lc::CameraConfiguration& configuration, const CameraConfig& asked,
                     const std::string& identity) {
  lc::StreamConfiguration& stream = configuration.at(0);
  const std::string offer = describe(stream.formats());
  const lc::Size size(static_cast<unsigned>(asked.width), static_cast<unsigned>(asked.height));
  const std::string& key = asked.libcamera.pixel_format;
  for (const Known& known : known_formats()) {
    if (key != "auto" && key != known.key) continue;
    stream.pixelFormat = known.format;
    stream.size = size;
    stream.stride = 0;
    stream.bufferCount = 4;
    // validate() bends what it cannot do; unbent in size and format, the mode is there.
    if (configuration.validate() != lc::CameraConfiguration::Invalid &&
        stream.pixelFormat == known.format && stream.size == size) {
      return known.choice;
    }
  }
  throw live::ModeError(
      fmt::format("{} has no mode {}x{}{}: set camera.width, camera.height and "
                  "camera.libcamera.pixel_format to one of: {}",
                  identity, asked.width, asked.height, key == "auto" ? "" : " in " + key, offer));
}

live::Format format_of(const lc::StreamConfiguration& stream, const Choice& choice) {
  live::Format format;
  format.encoding = choice.encoding;
  format.width = static_cast<int>(stream.size.width);
  format.height = static_cast<int>(stream.size.height);
  format.bytes_per_line = stream.stride;
  // Where nothing is said: bare sensor values are full, YCbCr of a video device is limited.
  format.full_range = stream.colorSpace ? stream.colorSpace->range == lc::ColorSpace::Range::Full
                                        : stream.pixelFormat == lc::formats::R8;
  return format;
}

void check_pixel_format(const std::string& key) {
  const auto& formats = known_formats();
  if (key == "auto" || std::ranges::any_of(formats, [&](const Known& k) { return key == k.key; })) {
    return;
  }
  throw std::runtime_error(fmt::format(
      "camera.libcamera.pixel_format = \"{}\": allowed are auto, grey, nv12, yuv420, yuyv, mjpeg",
      key));
}

}  // namespace dtact::hal::libcamera_backend
