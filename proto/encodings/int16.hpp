#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::wire {

/// DEPTH_INT16: `depth` row-major as little-endian int16. Replaces `out`.
void encode_int16(std::span<const std::int16_t> depth, std::string& out);

/// The reverse. False when the map has no pixels or too many, or `bytes` is not exactly
/// 2 × width × height long; `depth` is then unspecified.
[[nodiscard]] bool decode_int16(std::string_view bytes, std::size_t width, std::size_t height,
                                std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
