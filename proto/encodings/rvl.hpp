#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dtact::wire {

/// DEPTH_RVL: A. D. Wilson, "Fast Lossless Depth Image Compression", ISS 2017, listing 1, on our
/// signed values: by turns the number of zeros and of other values that follow, then those values,
/// each as the zigzag of its difference from the last one that was not 0 (0 at the beginning of the
/// map; rows mean nothing). Every number is cut into groups of three bits, the lowest first, each a
/// nibble whose highest bit says that more follow; eight nibbles make a 32-bit word, the first one
/// highest, and the last word is filled up with 0. The listing writes words as its machine has
/// them; here they are little-endian, as on every machine it ran on.
///
/// Holds its scratch, so that steady use does not allocate. One thread at a time.
class RvlEncoder {
 public:
  /// `depth`: row-major, at most kMaxPixels. Replaces `out`. Throws std::length_error for more.
  void encode(std::span<const std::int16_t> depth, std::string& out);

 private:
  std::vector<std::uint32_t> words_;
};

/// The reverse. False when the map has no pixels or too many, or `bytes` is not exactly what the
/// encoder makes of a map of this size; `depth` is then unspecified.
[[nodiscard]] bool decode_rvl(std::string_view bytes, std::size_t width, std::size_t height,
                              std::vector<std::int16_t>& depth);

}  // namespace dtact::wire
