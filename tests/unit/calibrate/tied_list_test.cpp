// A list of one press at the zero of another list.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "clients/calibrate/fit/list_fit.hpp"
#include "clients/calibrate/fit/model/layered_build.hpp"

namespace dtact::calibration {
namespace {

constexpr double kPx = 0.05;
constexpr int kSide = 160;

/// A contact of 3 mm that is 45 grey levels dark in its middle and 12 at its edge.
LevelledPress press() {
  LevelledPress made;
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
recon::DepthList list_of(const std::function<double(double)>& mm) {
  recon::DepthList list;
  list.first_q6 = -40 * 64;
  list.covered_from_q6 = -5 * 64;
  list.covered_to_q6 = 46 * 64;
  for (int q6 = list.first_q6; q6 <= 110 * 64; ++q6) {
    list.um.push_back(static_cast<std::int16_t>(std::lround(1000 * mm(q6 / 64.0))));
  }
  return list;
}

// The press's own list bends; the layer's is a straight line through zero.
recon::DepthList own() {
  return list_of([](double level) { return 0.02 * level + 0.0002 * level * level; });
}
recon::DepthList straight() {
  return list_of([](double level) { return 0.033 * level; });
}

TEST(TiedList, ReadsThePressAsDeepAsTheLayerDoes) {
  const recon::DepthList layer = straight();
  const TiedList tied = tie(own(), {&layer, 1}, press());
  const LevelledPress seen = press();
  double apart = 0;
  double pixels = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      if (distance_mm(seen.map, seen.contact, x, y) >= 2.7) continue;
      apart += look_up_mm(tied.list, seen.map.at(x, y)) - look_up_mm(layer, seen.map.at(x, y));
      pixels += 1;
    }
  }
  EXPECT_NEAR(apart / pixels, 0, 1e-3);
  // 0.033 l − 0.02 l − 0.0002 l² over levels that are evenly spread between 18 and 45.
  EXPECT_NEAR(tied.moved_mm, 0.0130 * 31.6 - 0.0002 * (31.6 * 31.6 + 27.0 * 27.0 / 12), 0.003);
}

TEST(TiedList, HasTheShapeOfItsOwnPressWhereThatIsSure) {
  const recon::DepthList layer = straight();
  const TiedList tied = tie(own(), {&layer, 1}, press());
  for (const double level : {20.0, 30.0, 45.0}) {
    EXPECT_NEAR(look_up_mm(tied.list, level), look_up_mm(own(), level) + tied.moved_mm, 2e-3)
        << level;
  }
  EXPECT_EQ(tied.list.covered_from_q6, own().covered_from_q6);
  EXPECT_EQ(tied.list.covered_to_q6, own().covered_to_q6);
}

TEST(TiedList, IsTheLayersWhereNothingIsPressed) {
  const recon::DepthList layer = straight();
  const TiedList tied = tie(own(), {&layer, 1}, press());
  EXPECT_EQ(look_up_mm(tied.list, 0), 0);
  EXPECT_NEAR(look_up_mm(tied.list, -10), -0.33, 1e-3);
  EXPECT_TRUE(std::ranges::is_sorted(tied.list.um));
}

// The layer counts in shares of a light that is a fifth brighter at the press.
TEST(TiedList, ConvertsTheLayersLevels) {
  const recon::DepthList layer = list_of([](double level) { return 0.033 * level / 1.2; });
  const recon::DepthList same = straight();
  const TiedList tied = tie(own(), {&layer, 1.2}, press());
  const TiedList expected = tie(own(), {&same, 1}, press());
  EXPECT_NEAR(tied.moved_mm, expected.moved_mm, 1e-3);
  for (const double level : {-10.0, 5.0, 15.0, 40.0}) {
    EXPECT_NEAR(look_up_mm(tied.list, level), look_up_mm(expected.list, level), 2e-3) << level;
  }
}

TEST(TiedList, MeanLevelIsOfTheSurePart) {
  // Evenly spread between 45 in the middle and 45 − 33 · 0.81 at nine tenths of the radius.
  EXPECT_NEAR(mean_level(press()), 45 - 33 * 0.81 / 2, 0.2);
}

}  // namespace
}  // namespace dtact::calibration
