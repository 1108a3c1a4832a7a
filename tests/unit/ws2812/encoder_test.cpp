#include "hal/ws2812/encoder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <ostream>
#include <span>
#include <stdexcept>

#include "tests/unit/ws2812/chain_model.hpp"

namespace dtact::hal {
inline void PrintTo(const Rgb& c, std::ostream* out) {
  *out << '(' << int{c.r} << ' ' << int{c.g} << ' ' << int{c.b} << ')';
}
}  // namespace dtact::hal

namespace dtact::hal::ws2812 {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;

std::vector<std::uint8_t> payload(Rgb led, const SpiFormat& format) {
  const std::array leds{led};
  auto bytes = encode(leds, format);
  const auto latch = static_cast<std::ptrdiff_t>(latch_bytes(format.hz));
  return {bytes.begin() + latch, bytes.end() - latch};
}

// Spelt out by hand from the table in encoder.hpp: green 0xA5 = 1010 0101, red 0xFF, blue 0x0F.
constexpr Rgb kProbe{0xFF, 0xA5, 0x0F};

TEST(Ws2812Encoder, SpellsWithThreeBits) {
  EXPECT_THAT(payload(kProbe, {3, 2'700'000}), ElementsAre(0xD3, 0x49, 0xA6,    // 110 100 110 100 …
                                                           0xDB, 0x6D, 0xB6,    // 110 × 8
                                                           0x92, 0x4D, 0xB6));  // 100 × 4, 110 × 4
}

TEST(Ws2812Encoder, SpellsWithFourBits) {
  EXPECT_THAT(payload(kProbe, {4, 3'200'000}), ElementsAre(0xE8, 0xE8, 0x8E, 0x8E,    //
                                                           0xEE, 0xEE, 0xEE, 0xEE,    //
                                                           0x88, 0x88, 0xEE, 0xEE));  //
}

TEST(Ws2812Encoder, SpellsWithEightBits) {
  EXPECT_THAT(payload(kProbe, {8, 6'400'000}),
              ElementsAre(0xF8, 0xC0, 0xF8, 0xC0, 0xC0, 0xF8, 0xC0, 0xF8,    //
                          0xF8, 0xF8, 0xF8, 0xF8, 0xF8, 0xF8, 0xF8, 0xF8,    //
                          0xC0, 0xC0, 0xC0, 0xC0, 0xF8, 0xF8, 0xF8, 0xF8));  //
}

TEST(Ws2812Encoder, SurroundsTheLedsWithTheLatchTime) {
  // 300 µs at 3.2 MHz are 960 bits, 120 bytes; eight LEDs at four bits are 96 bytes.
  const std::array<Rgb, 8> white = Light::all({255, 255, 255});
  const auto bytes = encode(white, {4, 3'200'000});
  ASSERT_EQ(bytes.size(), 120U + 96 + 120);
  EXPECT_EQ(bytes[119], 0);
  EXPECT_EQ(bytes[120], 0xEE);
  EXPECT_EQ(bytes[215], 0xEE);
  EXPECT_EQ(bytes[216], 0);
  EXPECT_EQ(latch_bytes(2'500'000), 94U);  // 93.75
}

TEST(Ws2812Encoder, TheLatchOfEachEncoding) {
  EXPECT_EQ(latch_bytes(2'700'000), 102U);  // 302 µs
  EXPECT_EQ(latch_bytes(3'200'000), 120U);  // 300
  EXPECT_EQ(latch_bytes(6'400'000), 240U);  // 300
  const std::array<Rgb, 8> leds{};
  EXPECT_EQ(encode(leds, {3, 2'700'000}).size(), 276U);
  EXPECT_EQ(encode(leds, {4, 3'200'000}).size(), 336U);
  EXPECT_EQ(encode(leds, {8, 6'400'000}).size(), 672U);
}

TEST(Ws2812Encoder, NoLedsAreTwoLatches) {
  EXPECT_EQ(encode({}, {4, 3'200'000}), std::vector<std::uint8_t>(240, 0));
}

struct Edge {
  SpiFormat format;
  bool accepted;
};

TEST(Ws2812Encoder, AcceptsRatesUpToTheWindowsEdges) {
  constexpr std::array kEdges{
      Edge{{3, 2.50e6}, true},  Edge{{3, 2.49e6}, false}, Edge{{3, 2.40e6}, false},
      Edge{{3, 3.33e6}, true},  Edge{{3, 3.34e6}, false}, Edge{{4, 3.00e6}, true},
      Edge{{4, 2.99e6}, false}, Edge{{4, 3.20e6}, true},  Edge{{4, 4.54e6}, true},
      Edge{{4, 4.55e6}, false}, Edge{{8, 5.00e6}, true},  Edge{{8, 4.99e6}, false},
      Edge{{8, 6.40e6}, true},  Edge{{8, 8.33e6}, true},  Edge{{8, 8.34e6}, false}};
  for (const Edge& edge : kEdges) {
    EXPECT_EQ(why_refused(edge.format).empty(), edge.accepted)
        << edge.format.bits << " bits at " << edge.format.hz;
  }
}

TEST(Ws2812Encoder, RefusalNamesThePulseAndTheRatesThatFit) {
  const std::string sentence = why_refused({3, 2'400'000});
  EXPECT_THAT(sentence, HasSubstr("a 0's high pulse lasts 417 ns"));
  EXPECT_THAT(sentence, HasSubstr("use 2.50 … 3.33 MHz"));
  EXPECT_THAT(why_refused({4, 8'000'000}), HasSubstr("use 3.00 … 4.54 MHz"));
  EXPECT_THAT(why_refused({4, 0}), HasSubstr("use 3.00 … 4.54 MHz"));
}

TEST(Ws2812Encoder, RefusesOtherSpellings) {
  EXPECT_THROW((void)pulses_of({5, 4e6}), std::invalid_argument);
  EXPECT_THROW((void)why_refused({0, 4e6}), std::invalid_argument);
}

TEST(Ws2812Encoder, AChainShowsWhatWasEncoded) {
  std::array<Rgb, 8> leds{};
  for (unsigned i = 0; i < leds.size(); ++i) {
    leds[i] = {static_cast<std::uint8_t>(i * 31), static_cast<std::uint8_t>(255 - i),
               static_cast<std::uint8_t>(1U << i)};
  }
  for (const SpiFormat format : {SpiFormat{3, 2.5e6}, SpiFormat{3, 2.7e6}, SpiFormat{3, 3.3e6},
                                 SpiFormat{4, 3.2e6}, SpiFormat{8, 6.4e6}, SpiFormat{8, 5e6}}) {
    test::ChainModel chain;
    // A controller whose line idles high: without the leading zeros this would be a first bit.
    chain.level(true, 5e6);
    chain.spi(encode(leds, format), format.hz);
    EXPECT_THAT(chain.shown(), ElementsAreArray(leds)) << format.bits << " bits";
    EXPECT_EQ(chain.odd_pulses(), 1) << "the idle high and nothing else";
  }
}

// MOSI may rest at any level before, between and after pictures, depending on the controller.
TEST(Ws2812Encoder, AChainShowsWhatWasEncodedWhereverTheLineRests) {
  const std::array<Rgb, 2> first{Rgb{1, 2, 3}, Rgb{255, 128, 0}};
  const std::array<Rgb, 2> second{Rgb{0, 0, 0}, Rgb{255, 255, 255}};
  for (const SpiFormat format : {SpiFormat{3, 2.7e6}, SpiFormat{4, 3.2e6}, SpiFormat{8, 6.4e6}}) {
    for (const bool rests_high : {false, true}) {
      test::ChainModel chain;
      for (const auto& leds : {first, second}) {
        chain.level(rests_high, 5e6);
        chain.spi(encode(leds, format), format.hz);
        chain.level(rests_high, 5e6);
        EXPECT_THAT(chain.shown(), ElementsAreArray(leds)) << format.bits << " bits";
      }
    }
  }
}

// The reason why a chain beyond spidev's buffer is refused and not cut.
TEST(Ws2812Encoder, APictureInTwoTransfersIsAnother) {
  const std::array<Rgb, 4> leds{Rgb{1, 2, 3}, Rgb{4, 5, 6}, Rgb{7, 8, 9}, Rgb{10, 11, 12}};
  const SpiFormat format{4, 3.2e6};
  const auto bytes = encode(leds, format);
  const std::span<const std::uint8_t> all(bytes);
  for (const bool rests_high : {false, true}) {
    test::ChainModel chain;
    chain.spi(all.first(120 + 24), format.hz);
    chain.level(rests_high, 1e6);
    chain.spi(all.subspan(120 + 24), format.hz);
    EXPECT_NE(chain.shown(), std::vector<Rgb>(leds.begin(), leds.end()));
  }
}

// rpi_ws281x#381: LEDs show white for black when the clock is 0.4 of the requested one.
TEST(Ws2812Encoder, ASlowClockTurnsBlackIntoWhite) {
  const std::array<Rgb, 8> dark{};
  const std::array<Rgb, 8> white = Light::all({255, 255, 255});
  test::ChainModel chain;
  chain.spi(encode(dark, {4, 3.2e6}), 0.4 * 3.2e6);
  EXPECT_THAT(chain.shown(), ElementsAreArray(white));
}

TEST(Ws2812Encoder, AClockMayFallByTheWindowsWidth) {
  struct Case {
    int bits;
    double share;
  };
  for (const Case& c : {Case{3, 0.75}, Case{4, 0.66}, Case{8, 0.60}}) {
    const double fastest = window_of(c.bits).fastest;
    EXPECT_EQ(why_refused({c.bits, fastest}), "");
    EXPECT_EQ(why_refused({c.bits, fastest * (c.share + 0.001)}), "") << c.bits;
    EXPECT_NE(why_refused({c.bits, fastest * (c.share - 0.001)}), "") << c.bits;
  }
  EXPECT_EQ(why_refused({8, 0.626 * 8e6}), "");  // kFix in spi_wire.cpp promises this
}

}  // namespace
}  // namespace dtact::hal::ws2812
