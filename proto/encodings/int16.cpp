#include "proto/encodings/int16.hpp"

#include <bit>
#include <cstring>

#include "proto/encodings/map_size.hpp"

// Maps are copied to and from the wire as they lie in memory.
static_assert(std::endian::native == std::endian::little, "the wire's int16 are little-endian");

namespace dtact::wire {

void encode_int16(std::span<const std::int16_t> depth, std::string& out) {
  out.assign(reinterpret_cast<const char*>(depth.data()), depth.size_bytes());
}

bool decode_int16(std::string_view bytes, std::size_t width, std::size_t height,
                  std::vector<std::int16_t>& depth) {
  if (!plausible_size(width, height) || bytes.size() != 2 * width * height) return false;
  depth.resize(width * height);
  std::memcpy(depth.data(), bytes.data(), bytes.size());
  return true;
}

}  // namespace dtact::wire
