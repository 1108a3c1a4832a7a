#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "hal/frame.hpp"

namespace dtact::hal::sim {

/// What leaves the simulated device.
enum class Output : std::uint8_t {
  luma,  ///< V4L2 GREY, full range.
  yuyv,  ///< V4L2 YUYV, limited range as UVC cameras send it, neutral chroma.
  mjpeg  ///< Baseline JPEG, 4:2:2, quality 90 by default, neutral chroma.
};

/// Throws std::runtime_error naming the allowed values.
[[nodiscard]] Output output_from_name(std::string_view name);

/// What the simulated camera compresses with.
inline constexpr int kJpegQuality = 90;

/// Packs luma as the device would send it. All memory is taken at construction. One thread at a
/// time; not copyable.
class PayloadEncoder {
 public:
  /// Throws std::runtime_error when `width` is odd and the output has chroma.
  /// `jpeg_quality`: 1 … 95.
  PayloadEncoder(Output output, int width, int height, int jpeg_quality = kJpegQuality);
  PayloadEncoder(const PayloadEncoder&) = delete;
  PayloadEncoder& operator=(const PayloadEncoder&) = delete;
  ~PayloadEncoder();

  /// Bytes that no payload exceeds.
  [[nodiscard]] std::size_t capacity() const noexcept;
  /// Writes the payload to `out` (capacity() bytes) and returns its length.
  [[nodiscard]] std::size_t encode(const LumaView& luma, std::span<std::uint8_t> out) noexcept;

 private:
  class Jpeg;
  Output output_;
  int width_;
  int height_;
  std::unique_ptr<Jpeg> jpeg_;
};

}  // namespace dtact::hal::sim
