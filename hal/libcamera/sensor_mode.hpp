#pragma once

#include <libcamera/camera.h>

#include <optional>
#include <string>
#include <vector>

#include "hal/config.hpp"

namespace dtact::hal::libcamera_backend {

/// One of the sizes that a bare sensor can send, binned or cut out of its whole.
struct SensorMode {
  unsigned width = 0;      ///< Pixels.
  unsigned height = 0;     ///< Pixels.
  unsigned bit_depth = 0;  ///< Bits a pixel.
  double fps = 0;          ///< The most frames a second; 0 = not known.
};

/// The most frames a second that a camera with these controls gives as it is configured now; 0
/// where it doesn't say.
[[nodiscard]] double fastest_rate(const libcamera::ControlInfoMap& controls);

/// Whether a camera that gives at most `fastest` frames a second can give `asked`.
[[nodiscard]] bool keeps_rate(double fastest, double asked) noexcept;

/// The bits a pixel of a raw format, by libcamera's name for it; 0 for other formats.
[[nodiscard]] unsigned bit_depth(const std::string& format_name);

/// The modes that the sensor has, each with its rate, by configuring `camera` for each in turn with
/// a stream as in `configuration`. Empty where libcamera has no call to choose one (before 0.1).
[[nodiscard]] std::vector<SensorMode> list_sensor_modes(
    libcamera::Camera& camera, libcamera::CameraConfiguration& configuration);

/// Makes `configuration` use `mode`.
void set_sensor_mode(libcamera::CameraConfiguration& configuration, const SensorMode& mode);

/// Returns the mode with the most pixels, then the most bits, among those that are no smaller
/// than the requested picture and keep its rate. libcamera's own choice compares sizes only: an
/// IMX477 set to 800x600 runs at 2028x1520, hence at 40 frames a second.
[[nodiscard]] std::optional<SensorMode> choose_sensor_mode(const std::vector<SensorMode>& modes,
                                                           const CameraConfig& asked);

/// The sentence for a camera that can't keep the rate asked for in any mode.
[[nodiscard]] std::string too_slow(const std::string& identity, double fastest,
                                   const std::vector<SensorMode>& modes, const CameraConfig& asked);

}  // namespace dtact::hal::libcamera_backend
