#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/encodings/zstd_frame.hpp"

namespace dtact::wire {

/// DEPTH_DELTA_ZSTD: each pixel minus its left neighbour (the first of a row minus 0), modulo
/// 65536, as little-endian 16 bits, row-major; one zstd frame (RFC 8878) with its content size.
/// Holds the compressor's tables and scratch, so that steady use does not allocate. One thread at a
/// time.
class DeltaZstdEncoder {
 public:
  /// `depth`: row-major, a whole number of rows of `width` pixels. Replaces `out`. Throws
  /// std::runtime_error with zstd's own word (out of memory).
  void encode(std::span<const std::int16_t> depth, std::size_t width, std::string& out);

 private:
  /// Level 1: higher levels cost more than they save.
  ZstdCompressor zstd_{ZstdSettings{.level = 1}};
  std::vector<std::uint16_t> differences_;
};

/// The reverse. False when the map has no pixels or too many, or `bytes` is not one whole zstd
/// frame of exactly 2 × width × height bytes; `depth` is then unspecified.
[[nodiscard]] bool decode_delta_zstd(std::string_view bytes, std::size_t width, std::size_t height,
                                     std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
