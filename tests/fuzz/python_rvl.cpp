// The Python package's own RVL decoder, which is C, beside the C++ library's: two bytes each of
// width and height, then what is decoded. They take the same bytes and read the same values in
// them.
#include <string_view>
#include <vector>

#include "clients/python/src/dtact/_rvl_decode.h"
#include "proto/encodings/rvl.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  constexpr std::size_t kHead = 4;
  /// Python's caller lets no other map through than plausible ones; larger ones take longer.
  constexpr std::size_t kMostPixels = 100'000;
  if (size < kHead) return 0;
  const std::size_t width = data[0] + 256U * data[1];
  const std::size_t height = data[2] + 256U * data[3];
  const std::size_t pixels = width * height;
  if (pixels == 0 || pixels > kMostPixels) return 0;
  data += kHead;
  size -= kHead;
  std::vector<std::int16_t> map;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const bool decodes = wire::decode_rvl(bytes, width, height, map);
  std::vector<std::int16_t> of_python(pixels);
  const char* const wrong = rvl_decode(data, static_cast<std::ptrdiff_t>(size), of_python.data(),
                                       static_cast<std::ptrdiff_t>(pixels));
  fuzz::require((wrong == nullptr) == decodes, "both decoders take a map, or neither does");
  fuzz::require(!decodes || of_python == map, "both decoders read the same map");
  return 0;
}
