#include "hal/ws2812/encoder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dtact::hal::ws2812 {
namespace {

/// How many SPI bits of a spelling are high; the rest are low.
struct Spelling {
  int bits;
  int zero_high;
  int one_high;
};

Spelling spelling_of(int bits) {
  switch (bits) {
    case 3:
      return {3, 1, 2};
    case 4:
      return {4, 1, 3};
    case 8:
      return {8, 2, 5};
    default:
      throw std::invalid_argument(
          fmt::format("{} SPI bits for each WS2812B bit: allowed are 3, 4, 8", bits));
  }
}

class BitWriter {
 public:
  explicit BitWriter(std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}

  void put(bool high) {
    if (free_ == 0) {
      bytes_.push_back(0);
      free_ = 8;
    }
    --free_;
    if (high) bytes_.back() = static_cast<std::uint8_t>(bytes_.back() | (1U << free_));
  }

 private:
  std::vector<std::uint8_t>& bytes_;
  unsigned free_ = 0;
};

}  // namespace

Pulses pulses_of(const SpiFormat& format) {
  const Spelling s = spelling_of(format.bits);
  const double bit_ns = 1e9 / format.hz;
  return {s.zero_high * bit_ns, s.one_high * bit_ns, (s.bits - s.one_high) * bit_ns};
}

RateWindow window_of(int bits) {
  const Spelling s = spelling_of(bits);
  return {1e9 * std::max(s.zero_high / kZeroHighMaxNs, s.one_high / kOneHighMaxNs),
          1e9 * std::min({s.zero_high / kZeroHighMinNs, s.one_high / kOneHighMinNs,
                          (s.bits - s.one_high) / kLowMinNs})};
}

std::string why_refused(const SpiFormat& format) {
  const Pulses p = pulses_of(format);
  // A rate at the window's very edge is inside: a nanosecond's millionth is rounding.
  constexpr double kSlack = 1e-6;
  std::string outside;
  const auto check = [&](const char* name, double ns, double least, double most) {
    if (outside.empty() && (!(ns >= least - kSlack) || !(ns <= most + kSlack))) {
      outside =
          fmt::format("{} lasts {:.0f} ns and must last {:.0f} … {:.0f} ns", name, ns, least, most);
    }
  };
  check("a 0's high pulse", p.zero_high, kZeroHighMinNs, kZeroHighMaxNs);
  check("a 1's high pulse", p.one_high, kOneHighMinNs, kOneHighMaxNs);
  check("the low after a 1", p.min_low, kLowMinNs, kLatchNs);
  if (outside.empty()) return {};

  const RateWindow window = window_of(format.bits);
  return fmt::format(
      "at {:.3f} MHz with {} SPI bits for each WS2812B bit, {}: use {:.2f} … {:.2f} MHz",
      format.hz / 1e6, format.bits, outside, std::ceil(window.slowest / 1e4) / 100,
      std::floor(window.fastest / 1e4) / 100);
}

std::size_t latch_bytes(double hz) {
  // Rounding must not make a byte of a whole number's last digit.
  return static_cast<std::size_t>(std::ceil(kLatchNs * 1e-9 * hz / 8 - 1e-6));
}

std::vector<std::uint8_t> encode(std::span<const Rgb> leds, const SpiFormat& format) {
  const Spelling s = spelling_of(format.bits);
  const std::size_t latch = latch_bytes(format.hz);
  std::vector<std::uint8_t> bytes(latch, 0);
  bytes.reserve(2 * latch + leds.size() * 3 * static_cast<std::size_t>(s.bits));
  BitWriter writer(bytes);
  for (const Rgb& led : leds) {
    for (const std::uint8_t channel : {led.g, led.r, led.b}) {
      for (int bit = 7; bit >= 0; --bit) {
        const int high = (channel >> bit & 1) != 0 ? s.one_high : s.zero_high;
        for (int i = 0; i < s.bits; ++i) writer.put(i < high);
      }
    }
  }
  bytes.insert(bytes.end(), latch, 0);
  return bytes;
}

}  // namespace dtact::hal::ws2812
