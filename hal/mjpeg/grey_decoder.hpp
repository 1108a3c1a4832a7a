#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "hal/frame.hpp"

namespace dtact::hal::mjpeg {

enum class Status : std::uint8_t {
  ok,
  empty,       ///< No bytes.
  not_jpeg,    ///< Does not begin with a JPEG's first marker.
  truncated,   ///< The bytes end before the end-of-image marker.
  corrupt,     ///< A marker or the entropy-coded data is broken; the picture cannot be trusted.
  wrong_size,  ///< A whole JPEG of another size.
  unsupported  ///< Not baseline, not one interleaved scan, or 12 bits: no camera sends that.
};

/// The cause in words, without a full stop ("the payload ends before the end-of-image marker").
[[nodiscard]] const char* describe(Status status) noexcept;

/// Why frames of a pixel format ("MJPEG", "GREY") are not decoded at 1/scale of their size
/// (CameraConfig::decode_scale), and the fix. Empty where they are.
[[nodiscard]] std::string scale_error(int scale, std::string_view pixel_format);

struct Size {
  int width = 0;   ///< Pixels.
  int height = 0;  ///< Pixels.
  bool operator==(const Size&) const = default;
};

/// Decodes the luma of JPEG frames of one size, full range by JFIF's definition. Colour is parsed
/// (the entropy code is interleaved) and never transformed. Frames stand alone: nothing of an
/// earlier one is used, and missing Huffman tables are the standard's (as UVC's MJPEG leaves them
/// out). All memory is taken at construction: decode() never allocates. One thread at a time;
/// move-only.
class GreyDecoder {
 public:
  /// `width` and `height`: of the JPEGs, pixels. `scale`: 1, 2 or 4; decode() gives 1/scale of the
  /// pixels in each direction, each about the mean of the scale × scale that it stands for. They
  /// come from the low frequencies alone, which takes less time. Throws
  /// std::invalid_argument unless both sides are 1…16384 pixels and multiples of the scale,
  /// std::runtime_error when libjpeg refuses to start.
  GreyDecoder(int width, int height, int scale = 1);
  GreyDecoder(GreyDecoder&&) noexcept;
  GreyDecoder& operator=(GreyDecoder&&) noexcept;
  GreyDecoder(const GreyDecoder&) = delete;
  GreyDecoder& operator=(const GreyDecoder&) = delete;
  ~GreyDecoder();

  /// From now on decode() computes only the pixels needed to give those of `crop` unchanged;
  /// what it writes elsewhere in the picture is unspecified. All of the payload is
  /// still parsed, so damage anywhere is reported. In pixels of what decode() gives. A crop without
  /// pixels, or one that leaves the picture, means the whole picture.
  void set_crop(const Area& crop) noexcept;

  /// Writes width/scale × height/scale bytes to `luma`, rows `stride` bytes apart. Unless ok the
  /// output is partly written and must not be used: libjpeg would fill a damaged frame with grey.
  /// Bytes after the end-of-image marker are ignored (drivers pad their payloads).
  [[nodiscard]] Status decode(std::span<const std::uint8_t> payload, std::uint8_t* luma,
                              std::ptrdiff_t stride) noexcept;

  /// The size that the payload's header states, whatever this decoder's own is.
  [[nodiscard]] Status read_size(std::span<const std::uint8_t> payload, Size& size) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::hal::mjpeg
