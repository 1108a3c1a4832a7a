#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/light_ring.hpp"

namespace dtact::hal::ws2812 {

// The WS2812B's one-wire code: each bit is a high pulse, short for 0 and long for 1, then low. A
// long low latches what was shifted in. Nanoseconds.
//
//                    WS2812B-2020    WS2812B of 2014     accepted here
//   0, high  T0H     220 … 380       250 … 550           200 … 400
//   1, high  T1H     580 … 1000      650 … 950           600 … 1000
//   low  T0L, T1L    from 220        from 300            from 220
//   latch  RES       over 280 000    over 50 000         300 000
//
// The accepted window is what both generations distinguish. Between 400 and 600 one chip may read a
// 0 where another reads a 1, and no chip promises to see a low shorter than 220.
inline constexpr double kZeroHighMinNs = 200;
inline constexpr double kZeroHighMaxNs = 400;
inline constexpr double kOneHighMinNs = 600;
inline constexpr double kOneHighMaxNs = 1000;
inline constexpr double kLowMinNs = 220;
inline constexpr double kLatchNs = 300'000;

/// How SPI bits encode a WS2812B bit at `hz` SPI bits a second.
///
///   bits   0          1          high 0, high 1, least low       so hz may be
///   3      100        110        1, 2, 1 SPI bits                2.50 … 3.33 MHz
///   4      1000       1110       1, 3, 1                         3.00 … 4.54 MHz
///   8      11000000   11111000   2, 5, 3                         5.00 … 8.33 MHz
///
/// At 4 and 8 bits every byte ends low, so a controller that pauses between bytes only lengthens a
/// low. At 3 bits a byte ends inside a pulse and a pause would turn a 0 into a 1.
///
/// A clock that drops after configuration may drop by the ratio of the fastest to the
/// slowest rate: to 75 % at 3 bits, 66 % at 4, 60 % at 8. Below that a 0's pulse grows until LEDs
/// read a 1 and all of them turn white.
struct SpiFormat {
  int bits = 4;           ///< SPI bits for each WS2812B bit: 3, 4 or 8.
  double hz = 3'200'000;  ///< SPI clock.
};

/// The pulses a format makes, nanoseconds.
struct Pulses {
  double zero_high = 0;
  double one_high = 0;
  double min_low = 0;
};
/// Throws std::invalid_argument when `bits` is not 3, 4 or 8.
[[nodiscard]] Pulses pulses_of(const SpiFormat& format);

/// SPI clocks at which every pulse of a spelling lies in the window, hertz.
struct RateWindow {
  double slowest = 0;
  double fastest = 0;
};
/// Throws std::invalid_argument like pulses_of().
[[nodiscard]] RateWindow window_of(int bits);

/// Empty when the format's pulses lie in the window; else the sentence that says which pulse is
/// outside and which clock rates fit. Throws std::invalid_argument like pulses_of().
[[nodiscard]] std::string why_refused(const SpiFormat& format);

/// Bytes to send, most significant bit first: zeros for the latch time, the LEDs in the order
/// green, red, blue, zeros for the latch time.
///
/// The trailing zeros latch the colours whatever level the data line (MOSI) rests at after them.
/// The leading zeros are for controllers whose line rests high: the long high would be the first
/// LED's first bit (green) and everything after it shifted; low for the latch time, it is
/// forgotten. A line that rests low needs neither. Zeros and bytes for 8 LEDs:
///
///   bits, hz         zeros, each side        in all      LEDs that fit spidev's 4096 bytes
///   3, 2.7 MHz       102 bytes = 302 µs      276         432
///   4, 3.2 MHz       120 bytes = 300 µs      336         321
///   8, 6.4 MHz       240 bytes = 300 µs      672         150
///
/// All of it must be one transfer: between two the line rests, long enough for LEDs to latch half a
/// picture, or high, which is a bit. Needs a format that why_refused() accepts.
[[nodiscard]] std::vector<std::uint8_t> encode(std::span<const Rgb> leds, const SpiFormat& format);

/// Zero bytes on each side of the LEDs' bytes in encode().
[[nodiscard]] std::size_t latch_bytes(double hz);

}  // namespace dtact::hal::ws2812
