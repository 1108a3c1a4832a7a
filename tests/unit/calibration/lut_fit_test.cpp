#include "clients/calibrate/fit/lut_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/unit/calibration/ball.hpp"
#include "tests/unit/calibration/lut_reading.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

recon::DepthLut fit(const DarkeningMap& map) { return fit_lut(map, find_contact(map, 4)); }

TEST(FitLut, FindsALinearResponseWithoutKnowingTheDepth) {
  const recon::DepthLut lut = fit(Ball{}.map());
  // 30 levels a millimetre.
  for (const double level : {0.0, 3.0, 10.0, 20.0, 30.0, 44.0}) {
    EXPECT_NEAR(um_at(lut, level), level / 30 * 1000, 8) << level;
  }
}

TEST(FitLut, NoContactReadsZero) { EXPECT_EQ(um_at(fit(Ball{}.map()), 0), 0); }

TEST(FitLut, SpansAndCoversWhatItSays) {
  const recon::DepthLut lut = fit(Ball{}.map());
  EXPECT_EQ(lut.first_q6, -2560);
  EXPECT_EQ(lut.um.size(), 150U * 64 + 1);
  EXPECT_NEAR(lut.covered_to_q6, 47 * 64, 20) << "the peak of 45 levels and two more";
  EXPECT_NEAR(lut.covered_from_q6, -20 * 64, 1) << "the ring";
  EXPECT_NO_THROW(recon::check(lut, true));
  EXPECT_NEAR(um_at(lut, 50), 1667, 12) << "goes on along its line";
}

TEST(FitLut, IsMonotoneAndStraightUnderNoise) {
  DarkeningMap map = Ball{}.map();
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.3F);  // the rest of one grey level after smoothing
  for (float& level : map.levels) level += noise(random);
  const recon::DepthLut lut = fit(map);
  EXPECT_TRUE(std::ranges::is_sorted(lut.um));
  for (const double level : {5.0, 15.0, 30.0, 42.0}) {
    EXPECT_NEAR(um_at(lut, level), level / 30 * 1000, 25) << level;
  }
}

TEST(FitLut, TheBulgeHasTheDentsVolume) {
  // Dent: a cap of 4 mm radius and 1.5 mm depth, π·1.5²·(4 − 0.5) = 24.74 mm³. The ring from 4 to
  // 6 mm has 62.83 mm², so its 20 levels are 0.394 mm.
  EXPECT_NEAR(um_at(fit(Ball{}.map()), -20), -394, 12);
}

TEST(FitLut, TheBulgeBeginsWithTheLutsOwnSlope) {
  const recon::DepthLut lut = fit(Ball{}.map());
  EXPECT_NEAR(um_at(lut, -0.5), -um_at(lut, 0.5), 3);
}

TEST(FitLut, PartOfThePixelsWillDo) {
  const DarkeningMap map = Ball{}.map();
  const recon::DepthLut lut =
      fit_lut(map, find_contact(map, 4), [](int x, int) { return x < 120; });
  EXPECT_NEAR(um_at(lut, 30), 1000, 8);
}

// The darkening's straight line ends at 1.5 mm; a gauge read 1.6.
TEST(FitLut, AMeasuredDepthSaysWhereZeroIs) {
  const DarkeningMap map = Ball{}.map();
  const recon::DepthLut lut = fit_lut(map, find_contact(map, 4), {}, 1.6);
  EXPECT_EQ(um_at(lut, 0), 0);
  for (const double level : {20.0, 30.0, 44.0}) {
    EXPECT_NEAR(um_at(lut, level), 100 + level / 30 * 1000, 8) << level;
  }
}

TEST(FitLut, SaysWhenTheImageIsNoBall) {
  DarkeningMap map = Ball{}.map();
  for (float& level : map.levels) level = level > 3 ? 20.0F : 0.0F;
  EXPECT_THAT([&] { (void)fit(map); },
              ThrowsMessage<std::runtime_error>(HasSubstr("does not darken steadily")));
}

// A curved response: its straight lines between the knots differ from any line through the origin.
TEST(Interpolate, RunsFromTheOriginFromKnotToKnotAndEndsAtTheLast) {
  const std::vector<Knot> knots{{4, 0.1, 5}, {10, 0.7, 3}, {12, 0.8, 1}};
  EXPECT_NEAR(interpolate(knots, 1), 0.025, 1e-12);
  EXPECT_NEAR(interpolate(knots, 4), 0.1, 1e-12);
  EXPECT_NEAR(interpolate(knots, 7), 0.4, 1e-12);
  EXPECT_NEAR(interpolate(knots, 11), 0.75, 1e-12);
  EXPECT_NEAR(interpolate(knots, 12), 0.8, 1e-12);
  EXPECT_NEAR(interpolate(knots, 30), 0.8, 1e-12);
}

// A press whose middle is 0.3 mm deep has in the three times larger ring about it a bulge of 0.1
// mm. The third ring is not in the picture.
TEST(MakeLut, GoesOnBeyondTheKnotsAndBalancesTheBulge) {
  const RadialProfile profile{0.1, {20, -7, std::nan("")}, {1, 1, 0}};
  const recon::DepthLut lut = make_lut({{10, 0.2, 1}, {20, 0.3, 1}}, 0.02, 0.05, profile);
  EXPECT_EQ(lut.first_q6, -40 * 64);
  EXPECT_EQ(lut.um.size(), 150U * 64 + 1);
  EXPECT_EQ(lut.covered_from_q6, -7 * 64);
  EXPECT_EQ(lut.covered_to_q6, 22 * 64);
  for (const auto& [level, um] :
       {std::pair{-7, -100}, {0, 0}, {5, 100}, {15, 250}, {20, 300}, {24, 500}}) {
    EXPECT_NEAR(um_at(lut, level), um, 1) << level;
  }
}

TEST(Lut, IsReadAtTheNearestEntryAndHeldAtItsEnds) {
  recon::DepthLut lut;
  lut.first_q6 = -64;
  for (int q6 = -64; q6 <= 128; ++q6) lut.um.push_back(static_cast<std::int16_t>(2 * q6));
  EXPECT_DOUBLE_EQ(lut_mm(lut, 0.5), 0.064);
  EXPECT_DOUBLE_EQ(lut_mm(lut, 0.51), 0.066);
  EXPECT_DOUBLE_EQ(lut_mm(lut, -1), -0.128);
  EXPECT_DOUBLE_EQ(lut_mm(lut, -3), -0.128);
  EXPECT_DOUBLE_EQ(lut_mm(lut, 2), 0.256);
  EXPECT_DOUBLE_EQ(lut_mm(lut, 9), 0.256);
}

// The depth grows with the square of the level, a micrometre at one level.
TEST(Lut, HasTheSlopeOfItsFirstTwentyLevels) {
  recon::DepthLut lut;
  for (int q6 = 0; q6 <= 40 * 64; ++q6) {
    lut.um.push_back(static_cast<std::int16_t>(std::lround(q6 * q6 / 4096.0)));
  }
  for (const auto& [covered, mm] : {std::pair{35, 0.020}, {20, 0.020}, {8, 0.008}}) {
    lut.covered_to_q6 = 64 * covered;
    EXPECT_NEAR(slope_mm(lut), mm, 1e-9) << covered;
  }
}

}  // namespace
}  // namespace dtact::calibration
