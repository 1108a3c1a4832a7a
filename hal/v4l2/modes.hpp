#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hal/config.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::v4l2 {

/// The pixel formats that the HAL turns into luma.
struct PixelFormat {
  std::uint32_t fourcc;
  const char* name;  ///< as in CameraInfo: "MJPEG"
  const char* key;   ///< as in the configuration: "mjpeg"
  live::Encoding encoding;
};

/// In the order of preference of "auto": luma as it is first, lossy compression last.
[[nodiscard]] const std::vector<PixelFormat>& supported_formats();
/// The entry of that fourcc, or null.
[[nodiscard]] const PixelFormat* find_format(std::uint32_t fourcc) noexcept;
/// Throws std::runtime_error naming `camera.v4l2.pixel_format` unless it is "auto" or a key.
void check_pixel_format(const std::string& key);

/// One size in one format, with the rates it runs at.
struct Mode {
  std::uint32_t fourcc = 0;
  int width = 0;              ///< Pixels; of a continuous range, the largest.
  int height = 0;             ///< Pixels.
  int min_width = 0;          ///< Equal to width unless the size is a range.
  int min_height = 0;         ///< Equal to height unless the size is a range.
  std::vector<double> fps;    ///< Frames a second, highest first. Empty: the driver doesn't say.
  bool fps_is_range = false;  ///< `fps` is the highest and the lowest of a range.

  /// The name in CameraInfo, or the four letters of a format that the HAL cannot read.
  [[nodiscard]] std::string format_name() const;
  [[nodiscard]] bool usable() const noexcept { return find_format(fourcc) != nullptr; }
  [[nodiscard]] bool has_size(int w, int h) const noexcept;
  [[nodiscard]] bool offers(int w, int h, double rate) const noexcept;
};

/// What the device at `fd` offers, formats that the HAL cannot read included. Empty when the
/// driver enumerates nothing.
[[nodiscard]] std::vector<Mode> list_modes(int fd);

/// The fourcc of the preferred mode with the size, rate and format asked for. Throws ModeError that
/// names what `name` offers.
[[nodiscard]] std::uint32_t choose(const std::vector<Mode>& modes, const CameraConfig& asked,
                                   const std::string& name);

/// The modes that would do instead, as describe() says them: those whose format can be read, and
/// those of the asked size first.
[[nodiscard]] std::string alternatives(const std::vector<Mode>& modes, const CameraConfig& asked);
/// "MJPEG 800x600 at 60, 30, 15; YUYV 640x480 at 30".
[[nodiscard]] std::string describe(const std::vector<Mode>& modes);
/// Four letters: "MJPG".
[[nodiscard]] std::string fourcc_text(std::uint32_t fourcc);

}  // namespace dtact::hal::v4l2
