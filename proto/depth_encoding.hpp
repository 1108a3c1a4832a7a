#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/dtact.pb.h"
#include "proto/encodings/int16.hpp"
#include "proto/encodings/predict_zstd.hpp"

namespace dtact::wire {

/// Whether maps can be sent so: dtact.v1.DepthEncoding without DEPTH_NONE.
[[nodiscard]] bool is_depth_encoding(v1::DepthEncoding encoding) noexcept;

/// Encodes maps in any of the encodings. Holds scratch for those that were used, so that steady use
/// does not allocate. One thread at a time.
class DepthEncoder {
 public:
  /// `depth`: row-major, a whole number of rows of `width` pixels. Replaces `out`. Throws
  /// std::invalid_argument for DEPTH_NONE, an unknown encoding or part of a row.
  void encode(v1::DepthEncoding encoding, std::span<const std::int16_t> depth, std::size_t width,
              std::string& out);

 private:
  PredictZstdEncoder predict_zstd_;
};

/// The reverse, for untrusted bytes. False for an unknown encoding, a map with no pixels or too
/// many, or `bytes` that are not exactly a map of this size; `depth` is then unspecified. Never
/// allocates more than some bytes for each pixel of the announced size.
[[nodiscard]] bool decode_depth(v1::DepthEncoding encoding, std::string_view bytes,
                                std::size_t width, std::size_t height,
                                std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
