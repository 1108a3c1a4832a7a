// A LUT of one press with the zero of another LUT.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"

namespace dtact::calibration {
namespace {

constexpr double kPx = 0.05;
constexpr int kSide = 160;

/// A contact of 3 mm that is 45 grey levels dark in its middle and 12 at its edge.
SymmetricPress press() {
  SymmetricPress made;
  made.map.width = made.map.height = kSide;
  made.map.mm_per_px = kPx;
  made.contact = {.col = 80, .row = 80, .radius_mm = 3, .ball_radius_mm = 4, .peak_levels = 45};
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double r = kPx * std::hypot(x - 80, y - 80);
      made.map.levels.push_back(static_cast<float>(r < 3.5 ? 45 - 33 * r * r / 9 : 0));
    }
  }
  return made;
}

/// Millimetres of a grey level, from −40 to 110 levels; covered from −5 to 46.
recon::DepthLut list_of(const std::function<double(double)>& mm) {
  recon::DepthLut lut;
  lut.first_q6 = -40 * 64;
  lut.covered_from_q6 = -5 * 64;
  lut.covered_to_q6 = 46 * 64;
  for (int q6 = lut.first_q6; q6 <= 110 * 64; ++q6) {
    lut.um.push_back(static_cast<std::int16_t>(std::lround(1000 * mm(q6 / 64.0))));
  }
  return lut;
}

// The press's own LUT is curved; the gel's is a straight line through zero.
recon::DepthLut own() {
  return list_of([](double level) { return 0.02 * level + 0.0002 * level * level; });
}
recon::DepthLut straight() {
  return list_of([](double level) { return 0.033 * level; });
}

TEST(ConstrainedLut, ReadsThePressAsDeepAsTheGelDoes) {
  const recon::DepthLut gel = straight();
  const ConstrainedLut tied = constrain(own(), {&gel, 1}, press());
  const SymmetricPress seen = press();
  double apart = 0;
  double pixels = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      if (distance_mm(seen.map, seen.contact, x, y) >= 2.7) continue;
      apart += lut_mm(tied.lut, seen.map.at(x, y)) - lut_mm(gel, seen.map.at(x, y));
      pixels += 1;
    }
  }
  EXPECT_NEAR(apart / pixels, 0, 1e-3);
  // 0.033 l − 0.02 l − 0.0002 l² over levels that are evenly spread between 18 and 45.
  EXPECT_NEAR(tied.moved_mm, 0.0130 * 31.6 - 0.0002 * (31.6 * 31.6 + 27.0 * 27.0 / 12), 0.003);
}

TEST(ConstrainedLut, HasTheShapeOfItsOwnPressWhereThatIsSure) {
  const recon::DepthLut gel = straight();
  const ConstrainedLut tied = constrain(own(), {&gel, 1}, press());
  for (const double level : {20.0, 30.0, 45.0}) {
    EXPECT_NEAR(lut_mm(tied.lut, level), lut_mm(own(), level) + tied.moved_mm, 2e-3) << level;
  }
  EXPECT_EQ(tied.lut.covered_from_q6, own().covered_from_q6);
  EXPECT_EQ(tied.lut.covered_to_q6, own().covered_to_q6);
}

TEST(ConstrainedLut, IsTheGelsWhereNothingIsPressed) {
  const recon::DepthLut gel = straight();
  const ConstrainedLut tied = constrain(own(), {&gel, 1}, press());
  EXPECT_EQ(lut_mm(tied.lut, 0), 0);
  EXPECT_NEAR(lut_mm(tied.lut, -10), -0.33, 1e-3);
  EXPECT_TRUE(std::ranges::is_sorted(tied.lut.um));
}

// The gel counts in shares of a light that is a fifth brighter at the press.
TEST(ConstrainedLut, ConvertsTheGelsLevels) {
  const recon::DepthLut gel = list_of([](double level) { return 0.033 * level / 1.2; });
  const recon::DepthLut same = straight();
  const ConstrainedLut tied = constrain(own(), {&gel, 1.2}, press());
  const ConstrainedLut expected = constrain(own(), {&same, 1}, press());
  EXPECT_NEAR(tied.moved_mm, expected.moved_mm, 1e-3);
  for (const double level : {-10.0, 5.0, 15.0, 40.0}) {
    EXPECT_NEAR(lut_mm(tied.lut, level), lut_mm(expected.lut, level), 2e-3) << level;
  }
}

TEST(ConstrainedLut, MeanLevelIsOfTheSurePart) {
  // Evenly spread between 45 in the middle and 45 − 33 · 0.81 at nine tenths of the radius.
  EXPECT_NEAR(mean_level(press()), 45 - 33 * 0.81 / 2, 0.2);
}

}  // namespace
}  // namespace dtact::calibration
