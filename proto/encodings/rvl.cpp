#include "proto/encodings/rvl.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <stdexcept>

#include "proto/encodings/map_size.hpp"

static_assert(std::endian::native == std::endian::little, "RVL's words travel as they lie here");

namespace dtact::wire {
namespace {

/// Numbers of up to nine bits as nibbles.
struct Code {
  std::uint16_t nibbles = 0;
  std::uint8_t bits = 0;  ///< 4, 8 or 12.
};
constexpr std::uint32_t kCodes = 512;

constexpr std::array<Code, kCodes> make_codes() {
  std::array<Code, kCodes> codes{};
  for (std::uint32_t value = 0; value < kCodes; ++value) {
    Code& code = codes.at(value);
    for (std::uint32_t rest = value, more = 1; more != 0; rest >>= 3U) {
      more = rest > 7 ? 8 : 0;
      code.nibbles =
          static_cast<std::uint16_t>((std::uint32_t{code.nibbles} << 4U) | more | (rest & 7U));
      code.bits = static_cast<std::uint8_t>(code.bits + 4);
    }
  }
  return codes;
}
constexpr std::array<Code, kCodes> kCode = make_codes();

class Writer {
 public:
  explicit Writer(std::uint32_t* to) noexcept : to_(to) {}

  void put(std::uint32_t value) noexcept {
    while (value >= kCodes) {
      const std::uint32_t three =
          ((value & 7U) << 8U) | ((value >> 3U & 7U) << 4U) | (value >> 6U & 7U);
      push(three | 0x888U, 12);
      value >>= 9U;
    }
    push(kCode[value].nibbles, kCode[value].bits);
  }
  /// Behind the last word.
  std::uint32_t* finish() noexcept {
    if (filled_ != 0) push(0, 32 - filled_);
    return to_;
  }

 private:
  void push(std::uint32_t nibbles, unsigned bits) noexcept {
    word_ = (word_ << bits) | nibbles;
    filled_ += bits;
    if (filled_ < 32) return;
    filled_ -= 32;
    *to_++ = static_cast<std::uint32_t>(word_ >> filled_);
  }

  std::uint32_t* to_;
  std::uint64_t word_ = 0;  ///< Its lowest `filled_` bits are not written yet.
  unsigned filled_ = 0;     ///< Below 32.
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) noexcept : bytes_(bytes) {}

  /// False when the words end, or the number is longer than any in a map or than it needs to be.
  bool take(std::uint32_t& value) noexcept {
    value = 0;
    for (unsigned shift = 0; shift < 30; shift += 3) {
      if (left_ == 0 && !load()) return false;
      const std::uint32_t nibble = word_ >> 28U;
      word_ <<= 4U;
      --left_;
      value |= (nibble & 7U) << shift;
      if (nibble < 8) return nibble != 0 || shift == 0;
    }
    return false;
  }
  /// All words are used, and the last one is filled up with 0.
  [[nodiscard]] bool at_end() const noexcept { return bytes_.empty() && word_ == 0; }

 private:
  bool load() noexcept {
    if (bytes_.size() < sizeof word_) return false;
    std::memcpy(&word_, bytes_.data(), sizeof word_);
    bytes_.remove_prefix(sizeof word_);
    left_ = 8;
    return true;
  }

  std::string_view bytes_;
  std::uint32_t word_ = 0;  ///< Its highest `left_` nibbles are not read yet; below them 0.
  unsigned left_ = 0;
};

/// `count` values that are not 0.
bool take_values(Reader& reader, std::span<std::int16_t> values, std::int32_t& previous) noexcept {
  for (std::int16_t& value : values) {
    std::uint32_t zigzag = 0;
    if (!reader.take(zigzag)) return false;
    const auto difference =
        static_cast<std::int32_t>(zigzag >> 1U) ^ -static_cast<std::int32_t>(zigzag & 1U);
    previous += difference;
    value = static_cast<std::int16_t>(previous);
    if (value != previous || value == 0) return false;
  }
  return true;
}

}  // namespace

void RvlEncoder::encode(std::span<const std::int16_t> depth, std::string& out) {
  if (depth.size() > kMaxPixels) throw std::length_error("a depth map above the wire's cap");
  // A value takes six nibbles at most and each pixel adds at most one to the run that it is in; the
  // number of zeros before the first value is one more, and the last word may be begun.
  if (const std::size_t most = (7 * depth.size() + 1) / 8 + 1; words_.size() < most) {
    words_.resize(most);
  }
  Writer writer(words_.data());
  std::int32_t previous = 0;
  const auto* at = depth.data();
  const auto* const end = at + depth.size();
  while (at != end) {
    const auto* const values = std::find_if(at, end, [](std::int16_t v) { return v != 0; });
    const auto* const zeros = std::find(values, end, std::int16_t{0});
    writer.put(static_cast<std::uint32_t>(values - at));
    writer.put(static_cast<std::uint32_t>(zeros - values));
    for (at = values; at != zeros; ++at) {
      const std::int32_t difference = *at - previous;
      writer.put(static_cast<std::uint32_t>((difference * 2) ^ (difference >> 31)));
      previous = *at;
    }
  }
  const auto words = static_cast<std::size_t>(writer.finish() - words_.data());
  out.assign(reinterpret_cast<const char*>(words_.data()), words * sizeof(std::uint32_t));
}

bool decode_rvl(std::string_view bytes, std::size_t width, std::size_t height,
                std::vector<std::int16_t>& depth) {
  if (!plausible_size(width, height)) return false;
  const std::size_t size = width * height;
  depth.resize(size);
  Reader reader(bytes);
  std::int32_t previous = 0;
  for (std::size_t at = 0; at < size;) {
    std::uint32_t zeros = 0;
    std::uint32_t values = 0;
    if (!reader.take(zeros) || zeros > size - at || (zeros == 0 && at != 0)) return false;
    std::fill_n(depth.begin() + static_cast<std::ptrdiff_t>(at), zeros, std::int16_t{0});
    at += zeros;
    if (!reader.take(values) || values > size - at || (values == 0 && at != size)) return false;
    if (!take_values(reader, std::span(depth).subspan(at, values), previous)) return false;
    at += values;
  }
  return reader.at_end();
}

}  // namespace dtact::wire
