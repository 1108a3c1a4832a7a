#include "daemon/recon/kernels.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <vector>

#include "daemon/recon/model.hpp"

namespace dtact::recon::kernels {
namespace {

using Entry = RectifyTable::Entry;

TEST(RectifyDifference, BilinearWeightsGiveQ6) {
  // 2×2 pixels; a quarter to the right and half down: (10·3/4 + 20/4 + 30·3/4 + 50/4)/2 = 23.75.
  const std::array<std::uint8_t, 4> luma{10, 20, 30, 50};
  const std::array<Entry, 3> entries{Entry{0, 0, 32, 64}, Entry{0, 0, 0, 0}, Entry{0, 0, 128, 128}};
  const std::array<std::int16_t, 3> reference{100 * 64, 100 * 64, 100 * 64};
  std::array<std::int16_t, 3> out{};
  rectify_difference_row(luma.data(), 2, entries.data(), reference.data(), 3, out.data());
  EXPECT_EQ(out[0], 4880);  // (100 − 23.75) · 64
  EXPECT_EQ(out[1], 5760);  // (100 − 10) · 64
  EXPECT_EQ(out[2], 3200);  // (100 − 50) · 64
}

TEST(RectifyDifference, RoundsHalfUpToQ6) {
  // One level times 1/128 is half a unit of Q6: 0.5 rounds to 1.
  const std::array<std::uint8_t, 4> luma{0, 1, 0, 1};
  const std::array<Entry, 2> entries{Entry{0, 0, 1, 0}, Entry{0, 0, 3, 0}};
  const std::array<std::int16_t, 2> reference{0, 0};
  std::array<std::int16_t, 2> out{};
  rectify_difference_row(luma.data(), 2, entries.data(), reference.data(), 2, out.data());
  EXPECT_EQ(out[0], -1);
  EXPECT_EQ(out[1], -2);
}

TEST(RectifyDifference, ReachesBothEndsOfItsRange) {
  const std::array<std::uint8_t, 4> white{255, 255, 255, 255};
  const std::array<std::uint8_t, 4> black{};
  const Entry entry{0, 0, 77, 99};
  const std::int16_t bright = 16320;
  const std::int16_t dark = 0;
  std::int16_t out = 0;
  rectify_difference_row(black.data(), 2, &entry, &bright, 1, &out);
  EXPECT_EQ(out, 16320);
  rectify_difference_row(white.data(), 2, &entry, &dark, 1, &out);
  EXPECT_EQ(out, -16320);
}

TEST(RectifyReference, Q8BecomesQ6) {
  const std::array<std::uint16_t, 4> luma{65280, 65280, 65280, 65280};
  const std::array<std::uint16_t, 4> fine{0, 3, 0, 3};
  const std::array<Entry, 2> entries{Entry{0, 0, 33, 1}, Entry{0, 0, 128, 0}};
  std::array<std::int16_t, 2> out{};
  rectify_reference_row(luma.data(), 2, entries.data(), 2, out.data());
  EXPECT_EQ(out[0], 16320);
  EXPECT_EQ(out[1], 16320);
  rectify_reference_row(fine.data(), 2, entries.data(), 2, out.data());
  EXPECT_EQ(out[1], 1);  // 3/256 of a level is 0.75 of a Q6 unit
}

TEST(Smooth, WeighsPairsAroundTheCentre) {
  const std::vector<std::int16_t> taps{8192, 4096};  // 1/4 1/2 1/4
  std::vector<std::int16_t> row(kBlock + 2);
  row[0] = 4;
  row[1] = 10;
  row[2] = -7;
  std::vector<std::int16_t> out(kBlock);
  smooth_horizontal_row(row.data() + 1, taps, kBlock, out.data());
  EXPECT_EQ(out[0], 4);   // (4 + 20 − 7)/4 = 4.25
  EXPECT_EQ(out[1], -1);  // (10 − 14 + 0)/4 = −1
  EXPECT_EQ(out[2], -2);  // −7/4 = −1.75
  EXPECT_EQ(out[3], 0);
}

TEST(Smooth, HalvesRoundUpOnBothSidesOfZero) {
  const std::vector<std::int16_t> taps{8192, 4096};
  std::vector<std::int16_t> row(kBlock + 2);
  row[1] = 1;   // centre: 0.5
  row[4] = -1;  // centre: −0.5
  std::vector<std::int16_t> out(kBlock);
  smooth_horizontal_row(row.data() + 1, taps, kBlock, out.data());
  EXPECT_EQ(out[0], 1);
  EXPECT_EQ(out[3], 0);
}

TEST(Smooth, TheGreatestValuesSurviveInBothDirections) {
  const std::vector<std::int16_t> taps{8192, 4096};
  for (const int value : {-16383, 16383}) {
    const std::vector<std::int16_t> row(kBlock + 2, static_cast<std::int16_t>(value));
    const std::array<const std::int16_t*, 3> rows{row.data(), row.data(), row.data()};
    std::vector<std::int16_t> out(kBlock);
    smooth_horizontal_row(row.data() + 1, taps, kBlock, out.data());
    EXPECT_EQ(out[kBlock - 1], value);
    smooth_vertical_row(rows.data(), taps, kBlock, out.data());
    EXPECT_EQ(out[kBlock - 1], value);
  }
}

TEST(Smooth, VerticalTakesRowsAboveAndBelow) {
  const std::vector<std::int16_t> taps{8192, 4096};
  const std::vector<std::int16_t> above(kBlock, 100);
  const std::vector<std::int16_t> centre(kBlock, 200);
  const std::vector<std::int16_t> below(kBlock, -300);
  const std::array<const std::int16_t*, 3> rows{above.data(), centre.data(), below.data()};
  std::vector<std::int16_t> out(kBlock);
  smooth_vertical_row(rows.data(), taps, kBlock, out.data());
  EXPECT_EQ(out[0], 50);  // 25 + 100 − 75
}

class GainLutMask : public testing::Test {
 protected:
  // −2 … 2 in Q6 become −20 … 20 µm; 3 stands for everything darker.
  const std::array<std::int16_t, 6> um{-20, -10, 0, 10, 20, kUntrusted};
  const LutView lut{um.data(), -2, 3, 2};
  int run(int difference, int gain, bool untrusted, int* depth) const {
    const auto d = static_cast<std::int16_t>(difference);
    const auto g = static_cast<std::int16_t>(gain);
    const std::uint8_t mark = untrusted ? 1 : 0;
    std::int16_t out = 0;
    const int beyond = gain_lut_mask_row(&d, &g, &mark, lut, 1, &out);
    *depth = out;
    return beyond;
  }
};

TEST_F(GainLutMask, LooksUpAndClamps) {
  int depth = 0;
  EXPECT_EQ(run(1, 4096, false, &depth), 0);
  EXPECT_EQ(depth, 10);
  EXPECT_EQ(run(2, 4096, false, &depth), 0);
  EXPECT_EQ(depth, 20);
  EXPECT_EQ(run(-32768, 4096, false, &depth), 0);
  EXPECT_EQ(depth, -20);
}

TEST_F(GainLutMask, BeyondTheCoveredRangeIsUntrustedAndCounted) {
  int depth = 0;
  EXPECT_EQ(run(3, 4096, false, &depth), 1);
  EXPECT_EQ(depth, kUntrusted);
  EXPECT_EQ(run(32767, 4096, false, &depth), 1);
  EXPECT_EQ(depth, kUntrusted);
}

TEST_F(GainLutMask, GainIsRoundedHalfUp) {
  int depth = 0;
  EXPECT_EQ(run(1, 2048, false, &depth), 0);  // 0.5 → 1
  EXPECT_EQ(depth, 10);
  EXPECT_EQ(run(-1, 2048, false, &depth), 0);  // −0.5 → 0
  EXPECT_EQ(depth, 0);
  EXPECT_EQ(run(1, 2047, false, &depth), 0);
  EXPECT_EQ(depth, 0);
}

TEST_F(GainLutMask, GreatestProductsSaturateInsteadOfWrapping) {
  int depth = 0;
  EXPECT_EQ(run(16320, 32767, false, &depth), 1);  // 130554 would wrap to −518
  EXPECT_EQ(depth, kUntrusted);
  EXPECT_EQ(run(-16320, 32767, false, &depth), 0);
  EXPECT_EQ(depth, -20);
}

TEST_F(GainLutMask, MarkComesLastAndHidesFromTheCount) {
  int depth = 0;
  EXPECT_EQ(run(1, 4096, true, &depth), 0);
  EXPECT_EQ(depth, kUntrusted);
  EXPECT_EQ(run(5, 4096, true, &depth), 0);
  EXPECT_EQ(depth, kUntrusted);
}

TEST_F(GainLutMask, WithoutGainAndMaskTheDifferenceIsLookedUp) {
  const std::array<std::int16_t, 2> difference{-1, 2};
  std::array<std::int16_t, 2> out{};
  EXPECT_EQ(gain_lut_mask_row(difference.data(), nullptr, nullptr, lut, 2, out.data()), 0);
  EXPECT_EQ(out[0], -10);
  EXPECT_EQ(out[1], 20);
}

TEST(Gain, IsTheQuotientInQ12) {
  const std::array<std::int16_t, 4> calibration{6400, 6400, 6400, 10240};
  const std::array<std::int16_t, 4> now{6400, 3200, 12800, 3000};
  std::array<std::int16_t, 4> gain{};
  std::array<std::uint8_t, 4> untrusted{};
  gain_row(calibration.data(), now.data(), 4, gain.data(), untrusted.data());
  EXPECT_EQ(gain[0], 4096);
  EXPECT_EQ(gain[1], 8192);
  EXPECT_EQ(gain[2], 2048);
  EXPECT_EQ(gain[3], 13981);  // 3.41333 · 4096 = 13981.01
  EXPECT_EQ(untrusted, (std::array<std::uint8_t, 4>{}));
}

TEST(Gain, DarkPixelsAndLightBelowAnEighthAreUntrusted) {
  // 511/64 of a level is below eight levels; 16000/2001 = 7.996 fits Q12 and 16000/2000 = 8 does
  // not.
  const std::array<std::int16_t, 6> calibration{511, 6400, 512, 16000, 16000, 6400};
  const std::array<std::int16_t, 6> now{6400, 511, 512, 2001, 2000, 0};
  std::array<std::int16_t, 6> gain{};
  std::array<std::uint8_t, 6> untrusted{0, 0, 0, 1, 0, 0};
  gain_row(calibration.data(), now.data(), 6, gain.data(), untrusted.data());
  EXPECT_NE(untrusted[0], 0);
  EXPECT_NE(untrusted[1], 0);
  EXPECT_EQ(untrusted[2], 0);
  EXPECT_EQ(untrusted[3], 1) << "a mark that was there stays";
  EXPECT_NE(untrusted[4], 0);
  EXPECT_NE(untrusted[5], 0);
  EXPECT_EQ(gain[3], 32752);  // 7.996 · 4096 = 32751.6
  EXPECT_EQ(gain[5], 4096);
}

TEST(Gain, WorksInPlace) {
  const std::int16_t calibration = 6400;
  std::int16_t value = 3200;
  std::uint8_t untrusted = 0;
  gain_row(&calibration, &value, 1, &value, &untrusted);
  EXPECT_EQ(value, 8192);
}

TEST(Scale, RoundsHalfUpAndSaturates) {
  const std::array<std::int16_t, 5> row{0, 1, 3, 16320, 32767};
  std::array<std::int16_t, 5> out{};
  scale_row(row.data(), kFactorOne, 5, out.data());
  EXPECT_EQ(out, row);
  scale_row(row.data(), kFactorOne / 2, 5, out.data());
  EXPECT_EQ(out, (std::array<std::int16_t, 5>{0, 1, 2, 8160, 16384}));
  scale_row(row.data(), 65535, 5, out.data());  // 1.99997
  EXPECT_EQ(out, (std::array<std::int16_t, 5>{0, 2, 6, 32640, 32767}));
}

TEST(Padded, RoundsUpToWholeBlocks) {
  EXPECT_EQ(padded(1), 32);
  EXPECT_EQ(padded(32), 32);
  EXPECT_EQ(padded(580), 608);
}

}  // namespace
}  // namespace dtact::recon::kernels
