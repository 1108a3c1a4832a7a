// A byte stream split into messages: as a whole and in pieces it gives the same ones.
#include "proto/framing.hpp"

#include <algorithm>

#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

constexpr std::size_t kCap = 4096;

struct Decoded {
  std::vector<std::string> messages;
  bool too_large = false;
  bool operator==(const Decoded&) const = default;
};

Decoded decode(std::string_view stream, std::size_t piece) {
  wire::MessageDecoder decoder(kCap);
  Decoded decoded;
  while (!stream.empty() && !decoded.too_large) {
    std::string_view input = stream.substr(0, piece);
    stream.remove_prefix(input.size());
    for (auto result = decoder.feed(input); result != wire::MessageDecoder::Result::need_more;
         result = decoder.feed(input)) {
      decoded.too_large = result == wire::MessageDecoder::Result::too_large;
      if (decoded.too_large) break;
      decoded.messages.push_back(decoder.message());
      require(decoder.message().size() <= kCap, "no message is above the cap");
    }
  }
  return decoded;
}

/// The definition, byte by byte: a four-byte big-endian length, then as many bytes.
Decoded expected(std::string_view stream) {
  Decoded decoded;
  while (stream.size() >= wire::kLengthSize) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < wire::kLengthSize; ++i) {
      length = length * 256 + static_cast<unsigned char>(stream[i]);
    }
    decoded.too_large = length > kCap;
    if (decoded.too_large || stream.size() - wire::kLengthSize < length) break;
    decoded.messages.emplace_back(stream.substr(wire::kLengthSize, length));
    stream.remove_prefix(wire::kLengthSize + length);
  }
  return decoded;
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact::fuzz;
  const std::string_view stream(reinterpret_cast<const char*>(data), size);
  const Decoded wanted = expected(stream);
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, std::max<std::size_t>(size, 1)}) {
    require(decode(stream, piece) == wanted, "a stream means the same in any pieces");
  }
  return 0;
}
