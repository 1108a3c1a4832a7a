#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "hal/frame.hpp"

namespace dtact::hal::luma {

/// Memory of one grey image, made once and used again. Rows begin at multiples of 64 bytes, and
/// kLumaPadding bytes after the last pixel may be read. Starts black. Move-only; a moved-from
/// buffer has no pixels.
class LumaBuffer {
 public:
  static constexpr std::size_t kAlignment = 64;

  LumaBuffer() = default;
  /// Throws std::invalid_argument unless both sides are 1…16384 pixels.
  LumaBuffer(int width, int height);
  LumaBuffer(LumaBuffer&& other) noexcept;
  LumaBuffer& operator=(LumaBuffer&& other) noexcept;
  LumaBuffer(const LumaBuffer&) = delete;
  LumaBuffer& operator=(const LumaBuffer&) = delete;
  ~LumaBuffer() = default;

  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int height() const noexcept { return height_; }
  [[nodiscard]] std::ptrdiff_t stride() const noexcept { return stride_; }
  [[nodiscard]] std::uint8_t* data() noexcept { return bytes_.get(); }
  [[nodiscard]] std::uint8_t* row(int y) noexcept { return bytes_.get() + y * stride_; }
  [[nodiscard]] LumaView view() const noexcept { return {bytes_.get(), width_, height_, stride_}; }

 private:
  struct Free {
    void operator()(std::uint8_t* bytes) const noexcept;
  };
  std::unique_ptr<std::uint8_t[], Free> bytes_;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

/// How an uncompressed payload is laid out. Chroma is skipped, never computed.
enum class Layout : std::uint8_t {
  grey,    ///< V4L2 GREY: one byte a pixel.
  grey10,  ///< V4L2 Y10: two bytes a pixel, little-endian, ten bits at the lower end.
  grey16,  ///< V4L2 Y16: two bytes a pixel, little-endian, all bits used.
  yuyv,    ///< V4L2 YUYV: Y0 U Y1 V, two bytes a pixel, even width.
  nv12     ///< V4L2 NV12: a plane of Y, then a half-size plane of UV pairs, even width and height.
};

/// Value range of a payload, from the driver's colour metadata (V4L2_QUANTIZATION_*) or
/// from the configuration. The payload itself does not show it.
enum class Range : std::uint8_t {
  full,    ///< 0 = black, 255 = white: taken as it is.
  limited  ///< 16 = black, 235 = white (ITU-R BT.601): expanded, what lies beyond saturates.
};

enum class ExtractStatus : std::uint8_t {
  ok,
  short_payload,  ///< Fewer bytes than the image needs: a truncated frame. Nothing was written.
  bad_shape       ///< Lines shorter than the width, or an odd side where the layout has none.
};

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
