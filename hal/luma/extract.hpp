#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/luma/luma_buffer.hpp"

namespace dtact::hal::luma {

/// How an uncompressed payload is laid out. Chroma is skipped, never computed.
enum class Layout : std::uint8_t {
  grey,    ///< V4L2 GREY: one byte a pixel.
  grey10,  ///< V4L2 Y10: two bytes a pixel, little-endian, ten bits at the lower end.
  grey16,  ///< V4L2 Y16: two bytes a pixel, little-endian, all bits used.
  yuyv,    ///< V4L2 YUYV: Y0 U Y1 V, two bytes a pixel, even width.
  nv12     ///< V4L2 NV12: a plane of Y, then a half-size plane of UV pairs, even width and height.
};

/// What the numbers of a payload mean; from the driver's colour metadata (V4L2_QUANTIZATION_*) or
/// from the configuration. Nothing in the payload tells them apart.
enum class Range : std::uint8_t {
  full,    ///< 0 = black, 255 = white: taken as it is.
  limited  ///< 16 = black, 235 = white (ITU-R BT.601): expanded.
};

enum class ExtractStatus : std::uint8_t {
  ok,
  short_payload,  ///< Fewer bytes than the image needs: a truncated frame. Nothing was written.
  bad_shape       ///< Lines shorter than the width, or an odd side where the layout has none.
};

/// One limited-range value in full range: (y − 16)·255/219 rounded to nearest, so 16 → 0 and
/// 235 → 255; below 16 and above 235 (foot- and headroom) saturate.
[[nodiscard]] std::uint8_t expand_limited(std::uint8_t y) noexcept;

/// The bytes that a payload must have at least: the last line needs no padding. For NV12 that is
/// the whole of both planes, so that a payload which lost its tail is noticed.
[[nodiscard]] std::size_t payload_bytes(Layout layout, int width, int height,
                                        std::ptrdiff_t bytes_per_line) noexcept;

/// Writes the payload's luma in full range into `out`, whose size says the image's. Lines of the
/// payload are `bytes_per_line` apart (0: no padding between lines); bytes after the image are
/// ignored; of more than eight bits the upper eight are taken. Reads each byte once, in wide loads:
/// the memory of some cameras is not cached. Does not allocate.
[[nodiscard]] ExtractStatus extract(Layout layout, Range range,
                                    std::span<const std::uint8_t> payload,
                                    std::ptrdiff_t bytes_per_line, LumaBuffer& out) noexcept;

}  // namespace dtact::hal::luma
