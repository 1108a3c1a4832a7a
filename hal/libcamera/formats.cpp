#include "hal/libcamera/formats.hpp"

#include <fmt/format.h>
#include <libcamera/formats.h>
#include <libcamera/property_ids.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

/// libcamera's formats.h has it since 0.1; the code is of drm_fourcc.h.
constexpr lc::PixelFormat kR16(std::uint32_t{'R'} | std::uint32_t{'1'} << 8U |
                               std::uint32_t{'6'} << 16U | std::uint32_t{' '} << 24U);

struct Known {
  const lc::PixelFormat& format;
  const char* key;
  Choice choice;
};

/// In the order of preference of "auto": luma as it is first, lossy compression last.
///
/// The three grey ones of a bare mono sensor bypass the image processor: its gamma, its noise
/// filters that smear in time, its scaling. A Pi 4 gives R8, or R10 where the sensor's driver has
/// no 8 bits (vc4.cpp: platformValidate()); a Pi 5 widens every raw stream to 16 bits (pisp.cpp:
/// platformValidate(); raspberrypi/picamera2#1010), and is asked for that, since its compressed
/// kind, MONO_PISP_COMP1, cannot be read. Unused bits are the upper ones on a Pi 4 and the lower
/// ones on a Pi 5 (Raspberry Pi's documentation of rpicam-raw, unpacked formats). A sensor has them
/// in its own sizes only: another size comes from the image processor.
const std::array<Known, 7>& known_formats() {
  static const std::array<Known, 7> formats{{
      {lc::formats::R8, "grey", {"GREY", live::Encoding::grey}},
      {kR16, "grey", {"Y16", live::Encoding::grey16}},
      {lc::formats::R10, "grey", {"Y10", live::Encoding::grey10}},
      {lc::formats::NV12, "nv12", {"NV12", live::Encoding::grey}},
      {lc::formats::YUV420, "yuv420", {"YUV420", live::Encoding::grey}},
      {lc::formats::YUYV, "yuyv", {"YUYV", live::Encoding::yuyv}},
      {lc::formats::MJPEG, "mjpeg", {"MJPEG", live::Encoding::jpeg}},
  }};
  return formats;
}

/// A colour sensor that is asked for grey sends its mosaic under that name: a Pi's pipeline keeps
/// the order of colours that was asked for (vc4.cpp: platformValidate()). More than eight bits are
/// known to lie as stated above for bare sensors only.
bool suits(const Known& known, Sensor sensor) {
  if (known.key != std::string("grey")) return true;
  return sensor == Sensor::mono ||
         (sensor == Sensor::none && known.choice.encoding == live::Encoding::grey);
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

Sensor sensor_of(const lc::ControlList& properties) {
  // Set for bare sensors only (camera_sensor.cpp: initProperties()).
  const auto colours = properties.get(lc::properties::draft::ColorFilterArrangement);
  if (!colours) return Sensor::none;
  return *colours == lc::properties::draft::MONO ? Sensor::mono : Sensor::colour;
}

bool driver_memory_is_cached(Sensor sensor) noexcept { return sensor == Sensor::none; }

Choice choose_format(lc::CameraConfiguration& configuration, const CameraConfig& asked,
                     Sensor sensor, const std::string& identity) {
  lc::StreamConfiguration& stream = configuration.at(0);
  // A pipeline that knows of colour spaces has filled one in. One that doesn't would leave there
  // what is asked for and keep to its own.
  const bool ranged = stream.colorSpace.has_value();
  const std::string offer = describe(stream.formats());
  const lc::Size size(static_cast<unsigned>(asked.width), static_cast<unsigned>(asked.height));
  const std::string& key = asked.libcamera.pixel_format;
  for (const Known& known : known_formats()) {
    if ((key != "auto" && key != known.key) || !suits(known, sensor)) continue;
    if (key == "auto" && asked.decode_scale != 1 && known.choice.encoding != live::Encoding::jpeg) {
      continue;
    }
    // A Pi gives Rec. 709 in limited range for video (pipeline_base.cpp: generateConfiguration()),
    // 14 % fewer grey levels than sYCC.
    if (ranged) stream.colorSpace = lc::ColorSpace::Sycc;
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
                  identity, asked.width, asked.height,
                  key != "auto"             ? " in " + key
                  : asked.decode_scale != 1 ? " in mjpeg, which camera.decode_scale needs"
                                            : "",
                  offer));
}

live::Format format_of(const lc::StreamConfiguration& stream, const Choice& choice) {
  live::Format format;
  format.encoding = choice.encoding;
  format.width = static_cast<int>(stream.size.width);
  format.height = static_cast<int>(stream.size.height);
  format.bytes_per_line = stream.stride;
  // Where nothing is said: bare sensor values are full, YCbCr of a video device is limited.
  const bool bare = stream.pixelFormat == lc::formats::R8 || stream.pixelFormat == kR16 ||
                    stream.pixelFormat == lc::formats::R10;
  format.full_range =
      stream.colorSpace ? stream.colorSpace->range == lc::ColorSpace::Range::Full : bare;
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
