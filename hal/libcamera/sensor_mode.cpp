#include "hal/libcamera/sensor_mode.hpp"

#include <fmt/format.h>
#include <libcamera/control_ids.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <memory>
#include <tuple>

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

/// The tolerance between a requested rate and that of a V4L2 driver.
constexpr double kRateTolerance = 0.5;

// A template, so that its members are looked up only where libcamera has them.
template <class Configuration>
bool set_mode(Configuration& configuration, const SensorMode& mode) {
  if constexpr (requires { configuration.sensorConfig; }) {
    auto& sensor = configuration.sensorConfig.emplace();
    sensor.bitDepth = mode.bit_depth;
    sensor.outputSize = lc::Size(mode.width, mode.height);
    return true;
  } else {
    return false;
  }
}

}  // namespace

double fastest_rate(const lc::ControlInfoMap& controls) {
  // libcamera 0.0.3: count() counts every control there is, not the camera's, and find() needs
  // some.
  if (controls.empty()) return 0;
  const auto limits = controls.find(lc::controls::FrameDurationLimits.id());
  if (limits == controls.end()) return 0;
  const auto us = limits->second.min().get<std::int64_t>();
  return us > 0 ? 1e6 / static_cast<double>(us) : 0;
}

bool keeps_rate(double fastest, double asked) noexcept {
  return fastest == 0 || fastest >= asked - kRateTolerance;
}

unsigned bit_depth(const std::string& format_name) {
  // R10_CSI2P, SRGGB10_CSI2P, SBGGR12, ...
  std::size_t i = 0;
  if (format_name.starts_with("R")) {
    i = 1;
  } else if (format_name.starts_with("S")) {
    i = 5;
  }
  unsigned bits = 0;
  for (; i > 0 && i < format_name.size() && std::isdigit(format_name[i]) != 0; ++i) {
    bits = bits * 10 + static_cast<unsigned>(format_name[i] - '0');
  }
  return bits;
}

std::vector<SensorMode> list_sensor_modes(lc::Camera& camera, lc::CameraConfiguration& wanted) {
  std::vector<SensorMode> modes;
  const auto raw = camera.generateConfiguration({lc::StreamRole::Raw});
  if (!raw || raw->empty()) return modes;
  const lc::StreamFormats& formats = raw->at(0).formats();
  for (const lc::PixelFormat& format : formats.pixelformats()) {
    for (const lc::Size& size : formats.sizes(format)) {
      SensorMode mode{size.width, size.height, bit_depth(format.toString()), 0};
      if (mode.bit_depth == 0 || !set_mode(wanted, mode)) continue;
      const lc::StreamConfiguration stream = wanted.at(0);
      if (wanted.validate() != lc::CameraConfiguration::Invalid && camera.configure(&wanted) == 0) {
        mode.fps = fastest_rate(camera.controls());
        modes.push_back(mode);
      }
      wanted.at(0) = stream;
    }
  }
  return modes;
}

void set_sensor_mode(lc::CameraConfiguration& configuration, const SensorMode& mode) {
  (void)set_mode(configuration, mode);
}

std::optional<SensorMode> choose_sensor_mode(const std::vector<SensorMode>& modes,
                                             const CameraConfig& asked) {
  std::optional<SensorMode> best;
  const auto rank = [](const SensorMode& m) {
    return std::tuple(std::size_t{m.width} * m.height, m.bit_depth);
  };
  for (const SensorMode& mode : modes) {
    const bool fits = mode.width >= static_cast<unsigned>(asked.width) &&
                      mode.height >= static_cast<unsigned>(asked.height);
    if (!fits || !keeps_rate(mode.fps, asked.fps)) continue;
    if (!best || rank(mode) > rank(*best)) best = mode;
  }
  return best;
}

std::string too_slow(const std::string& identity, double fastest,
                     const std::vector<SensorMode>& modes, const CameraConfig& asked) {
  std::string listed;
  for (const SensorMode& mode : modes) {
    listed += fmt::format("{}{}x{} with {} bits at up to {:.1f}",
                          listed.empty() ? "; its sensor has " : ", ", mode.width, mode.height,
                          mode.bit_depth, mode.fps);
  }
  return fmt::format(
      "{} gives at most {:.1f} frames a second at {}x{}, not {:g}: lower camera.fps, or "
      "camera.width and camera.height{}",
      identity, fastest, asked.width, asked.height, asked.fps, listed);
}

}  // namespace dtact::hal::libcamera_backend
