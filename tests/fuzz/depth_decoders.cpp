// The depth encodings as a daemon may send them: two bytes each of width and height, one of
// the encoding, then the encoded bytes. A decoded map has as many values as pixels, and every
// encoding of it decodes to the same.
#include <string>
#include <string_view>
#include <vector>

#include "proto/depth_encoding.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

constexpr std::size_t kHead = 5;
/// Larger maps are only decoded, so that an input takes milliseconds.
constexpr std::size_t kMaxPixels = 100'000;

void encode_again(v1::DepthEncoding sent, std::string_view bytes,
                  const std::vector<std::int16_t>& map, std::size_t width) {
  static wire::DepthEncoder encoder;
  for (const auto encoding : {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD}) {
    std::string again;
    encoder.encode(encoding, map, width, again);
    std::vector<std::int16_t> back;
    require(wire::decode_depth(encoding, again, width, map.size() / width, back) && back == map,
            "every encoding of a map decodes to it");
    // zstd has several encodings of the same content.
    require(encoding != v1::DEPTH_INT16 || encoding != sent || again == bytes,
            "a map has one int16 form");
  }
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  if (size < fuzz::kHead) return 0;
  const std::size_t width = data[0] + 256U * data[1];
  const std::size_t height = data[2] + 256U * data[3];
  const auto encoding = static_cast<v1::DepthEncoding>(data[4]);
  const std::string_view bytes(reinterpret_cast<const char*>(data) + fuzz::kHead,
                               size - fuzz::kHead);
  std::vector<std::int16_t> map;
  if (!wire::decode_depth(encoding, bytes, width, height, map)) return 0;
  fuzz::require(map.size() == width * height, "a depth map has as many values as pixels");
  if (map.size() <= fuzz::kMaxPixels) fuzz::encode_again(encoding, bytes, map, width);
  return 0;
}
