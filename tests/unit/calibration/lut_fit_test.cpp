#include "clients/calibrate/fit/lut_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

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

}  // namespace
}  // namespace dtact::calibration
