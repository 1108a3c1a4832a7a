// Arbitrary maps: a byte of the width less one, then int16 values. Every encoding decodes to the
// same map.
#include <cstring>
#include <string>
#include <vector>

#include "proto/depth_encoding.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  static wire::DepthEncoder encoder;
  if (size < 3) return 0;
  const std::size_t width = data[0] + 1U;
  const std::size_t height = (size - 1) / 2 / width;
  if (height == 0) return 0;
  std::vector<std::int16_t> map(width * height);
  std::memcpy(map.data(), data + 1, 2 * map.size());
  for (const auto encoding : {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD}) {
    std::string bytes;
    encoder.encode(encoding, map, width, bytes);
    std::vector<std::int16_t> back;
    fuzz::require(wire::decode_depth(encoding, bytes, width, height, back) && back == map,
                  "an encoded map decodes to itself");
  }
  return 0;
}
