#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/encodings/zstd_frame.hpp"

namespace dtact::wire {

/// DEPTH_PREDICT_ZSTD: each pixel's difference from left + above − above left (0 outside the
/// map), modulo 65536, as zigzag. So a map is the running sum of these residuals along rows and
/// columns. One zstd frame (RFC 8878) with its content size holds two parts: first a nibble for
/// each pixel, row-major, the first of two in the low half of a byte (an odd last one has 0 beside
/// it): the residual, or 15 when it is 15 or more. Then a byte for each 15: residual − 15, or, when
/// that is 255 or more, 255 and the residual as little-endian 16 bits.
///
/// After the reconstruction's own filter neighbours are so smooth that nearly all residuals are
/// below 15. zstd's entropy code spends a whole number of bits on each byte, so it wastes less
/// on two of them than on one.
///
/// Holds the compressor's tables and scratch, so steady use does not allocate. One thread at a
/// time.
class PredictZstdEncoder {
 public:
  /// `depth`: row-major, a whole number of rows of `width` pixels. Replaces `out`. Throws
  /// std::runtime_error with zstd's own word (out of memory).
  void encode(std::span<const std::int16_t> depth, std::size_t width, std::string& out);

 private:
  /// Noise repeats nothing: short matches cost more time and bytes than they save. Areas without
  /// contact need only a fast search and a small table.
  ZstdCompressor zstd_{
      ZstdSettings{.level = 1, .min_match = 7, .hash_log = 6, .target_length = 32}};
  std::vector<std::int16_t> nothing_;     ///< What lies above the first row.
  std::vector<std::uint16_t> residuals_;  ///< of one row
  std::vector<std::uint8_t> capped_;      ///< of all pixels
  std::vector<std::uint8_t> content_;
};

/// The reverse. False when the map has no pixels or too many, or `bytes` is not one whole zstd
/// frame of exactly the two parts; `depth` is then unspecified.
[[nodiscard]] bool decode_predict_zstd(std::string_view bytes, std::size_t width,
                                       std::size_t height, std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
