#include "proto/encodings/delta_zstd.hpp"

#include <bit>

#include "proto/encodings/map_size.hpp"

static_assert(std::endian::native == std::endian::little, "differences travel as they lie here");

namespace dtact::wire {

void DeltaZstdEncoder::encode(std::span<const std::int16_t> depth, std::size_t width,
                              std::string& out) {
  require_whole_rows(depth.size(), width);
  differences_.resize(depth.size());
  for (std::size_t row = 0; row < depth.size(); row += width) {
    const std::int16_t* from = depth.data() + row;
    std::uint16_t* to = differences_.data() + row;
    to[0] = static_cast<std::uint16_t>(from[0]);
    for (std::size_t x = 1; x < width; ++x)
      to[x] = static_cast<std::uint16_t>(from[x] - from[x - 1]);
  }
  zstd_.compress(std::as_bytes(std::span(differences_)), out);
}

bool decode_delta_zstd(std::string_view bytes, std::size_t width, std::size_t height,
                       std::vector<std::int16_t>& depth) {
  // What the frame says of itself comes first, so that a short message cannot make us allocate.
  if (!plausible_size(width, height) || zstd_content_size(bytes) != 2 * width * height)
    return false;
  depth.resize(width * height);
  if (!zstd_decompress(bytes, std::as_writable_bytes(std::span(depth)))) return false;
  for (std::size_t row = 0; row < depth.size(); row += width) {
    std::uint16_t left = 0;
    for (auto& pixel : std::span(depth).subspan(row, width)) {
      left = static_cast<std::uint16_t>(left + static_cast<std::uint16_t>(pixel));
      pixel = static_cast<std::int16_t>(left);
    }
  }
  return true;
}

}  // namespace dtact::wire
