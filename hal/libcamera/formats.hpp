#pragma once

#include <libcamera/camera.h>

#include <string>

#include "hal/config.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::libcamera_backend {

struct Choice {
  const char* name;         ///< As in CameraInfo: "NV12", "MJPEG".
  live::Encoding encoding;  ///< Of the first plane alone: that of the planar formats is luma.
};

/// Sets the first stream of `configuration` to the preferred format that `asked` allows and the
/// camera has at that size. Throws live::ModeError that names what `identity` offers.
[[nodiscard]] Choice choose_format(libcamera::CameraConfiguration& configuration,
                                   const CameraConfig& asked, const std::string& identity);

/// How a payload of the first plane of `stream` is to be read. `lendable` is left open.
[[nodiscard]] live::Format format_of(const libcamera::StreamConfiguration& stream,
                                     const Choice& choice);

/// Throws std::runtime_error naming `camera.libcamera.pixel_format`.
void check_pixel_format(const std::string& key);

}  // namespace dtact::hal::libcamera_backend
