#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::wire {

/// Most pixels of a map on the wire: its int16 form has to fit a message.
inline constexpr std::size_t kMaxPixels = std::size_t{8} << 20U;

/// DEPTH_INT16: `depth` row-major as little-endian int16. Replaces `out`.
void encode_int16(std::span<const std::int16_t> depth, std::string& out);

/// The reverse. False when the map has no pixels or too many, or `bytes` is not exactly
/// 2 × width × height long; `depth` is then unspecified.
[[nodiscard]] bool decode_int16(std::string_view bytes, std::size_t width, std::size_t height,
                                std::vector<std::int16_t>& depth);

/// DEPTH_DELTA_ZSTD: each pixel minus its left neighbour (the first of a row minus 0), modulo
/// 65536, as little-endian 16 bits, row-major; one zstd frame (RFC 8878) with its content size.
/// Holds the compressor's tables and scratch, so that steady use does not allocate. One thread at a
/// time.
class DeltaZstdEncoder {
 public:
  DeltaZstdEncoder();
  ~DeltaZstdEncoder();
  DeltaZstdEncoder(DeltaZstdEncoder&&) noexcept;
  DeltaZstdEncoder& operator=(DeltaZstdEncoder&&) noexcept;

  /// `depth`: row-major, a whole number of rows of `width` pixels. Replaces `out`. Level 1: the
  /// differences of a smooth map are small already, and higher levels cost more than they save.
  /// Throws std::runtime_error with zstd's own word (out of memory).
  void encode(std::span<const std::int16_t> depth, std::size_t width, std::string& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The reverse. False when the map has no pixels or too many, or `bytes` is not one whole zstd
/// frame of exactly 2 × width × height bytes; `depth` is then unspecified.
[[nodiscard]] bool decode_delta_zstd(std::string_view bytes, std::size_t width, std::size_t height,
                                     std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
