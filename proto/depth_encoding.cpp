#include "proto/depth_encoding.hpp"

#include <stdexcept>

#include "proto/encodings/map_size.hpp"

namespace dtact::wire {

bool is_depth_encoding(v1::DepthEncoding encoding) noexcept {
  return encoding != v1::DEPTH_NONE && v1::DepthEncoding_IsValid(encoding);
}

void DepthEncoder::encode(v1::DepthEncoding encoding, std::span<const std::int16_t> depth,
                          std::size_t width, std::string& out) {
  require_whole_rows(depth.size(), width);
  switch (encoding) {
    case v1::DEPTH_INT16:
      return encode_int16(depth, out);
    case v1::DEPTH_PREDICT_ZSTD:
      return predict_zstd_.encode(depth, width, out);
    default:
      throw std::invalid_argument("no depth encoding has the number " + std::to_string(encoding));
  }
}

bool decode_depth(v1::DepthEncoding encoding, std::string_view bytes, std::size_t width,
                  std::size_t height, std::vector<std::int16_t>& depth) {
  switch (encoding) {
    case v1::DEPTH_INT16:
      return decode_int16(bytes, width, height, depth);
    case v1::DEPTH_PREDICT_ZSTD:
      return decode_predict_zstd(bytes, width, height, depth);
    default:
      return false;
  }
}

}  // namespace dtact::wire
