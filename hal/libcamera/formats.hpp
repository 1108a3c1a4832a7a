#pragma once

#include <libcamera/camera.h>

#include <cstdint>
#include <string>

#include "hal/config.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {

/// What libcamera has before it: a camera that makes pictures by itself, as USB cameras do, or a
/// bare sensor, whose pictures an image processor on the board makes.
enum class Sensor : std::uint8_t { none, mono, colour };
[[nodiscard]] Sensor sensor_of(const libcamera::ControlList& properties);
/// Whether the memory that its driver gives is cached: what a camera sends that makes pictures by
/// itself is written by the processor.
[[nodiscard]] bool driver_memory_is_cached(Sensor sensor) noexcept;

struct Choice {
  const char* name;         ///< As in CameraInfo: "NV12", "MJPEG".
  live::Encoding encoding;  ///< Of the first plane alone: that of the planar formats is luma.
};

/// Sets the first stream of `configuration` to the preferred format that `asked` allows and the
/// camera has at that size, in full range where the camera lets it be chosen. `configuration` is as
/// the camera generated it. Throws live::ModeError that names what `identity` offers.
[[nodiscard]] Choice choose_format(libcamera::CameraConfiguration& configuration,
                                   const CameraConfig& asked, Sensor sensor,
                                   const std::string& identity);

/// How a payload of the first plane of `stream` is to be read, as it was granted. `zero_copy` is
/// left open.
[[nodiscard]] live::Format format_of(const libcamera::StreamConfiguration& stream,
                                     const Choice& choice);

/// Throws std::runtime_error naming `camera.libcamera.pixel_format`.
void check_pixel_format(const std::string& key);

}  // namespace dtact::hal::libcamera_backend
