#include "clients/calibrate/fit/contact.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(FindContact, CentreAndRadiusOfABall) {
  const Contact contact = find_contact(Ball{}.map(), 4);
  EXPECT_NEAR(contact.col, 120.25, 0.05);
  EXPECT_NEAR(contact.row, 110.5, 0.05);
  // Three levels are 0.1 mm, where the sag is 1.4 mm: r = √(16 − 2.6²) = 3.04.
  EXPECT_NEAR(contact.radius_mm, 3.04, 0.02);
  EXPECT_NEAR(contact.peak_levels, 45, 0.1);
  EXPECT_EQ(contact.ball_radius_mm, 4);
}

TEST(FindContact, RadiusIsAtMostMostOfTheBall) {
  EXPECT_DOUBLE_EQ(find_contact(Ball{.depth_mm = 3}.map(), 4).radius_mm, 3.4);
}

TEST(FindContact, UntrustedPixelsAreLeftOut) {
  DarkeningMap map = Ball{}.map();
  for (std::size_t i = 0; i < map.levels.size(); i += 11) {
    map.levels[i] = std::numeric_limits<float>::quiet_NaN();
  }
  const Contact contact = find_contact(map, 4);
  EXPECT_NEAR(contact.col, 120.25, 0.2);
  EXPECT_NEAR(contact.radius_mm, 3.04, 0.03);
}

TEST(FindContact, ADarkSpeckElsewhereDoesNotMoveTheCentre) {
  DarkeningMap map = Ball{}.map();
  map.levels[5 * 260 + 5] = 40;
  EXPECT_NEAR(find_contact(map, 4).col, 120.25, 0.05);
}

TEST(FindContact, SaysWithoutContact) {
  EXPECT_THAT([] { (void)find_contact(Ball{.depth_mm = 0.2}.map(), 4); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no contact found")));
}

TEST(FindContact, SaysWhenTheBallLeavesTheMap) {
  EXPECT_THAT([] { (void)find_contact(Ball{.col = 30}.map(), 4); },
              ThrowsMessage<std::runtime_error>(HasSubstr("leaves the map of 260x240")));
  EXPECT_THAT([] { (void)find_contact(Ball{.row = 225}.map(), 4); },
              ThrowsMessage<std::runtime_error>(HasSubstr("leaves the map")));
}

// The contact has a radius of 61 pixels. On a map that is wider than high, or higher than wide,
// each edge cuts by its own length.
TEST(FindContact, EachEdgeCutsTheContact) {
  const auto cut = [](const Ball& ball) {
    try {
      (void)find_contact(ball.map(), 4);
      return false;
    } catch (const std::runtime_error&) {
      return true;
    }
  };
  const Ball wide{.col = 180, .row = 120, .width = 360, .height = 240};
  const Ball high{.col = 120, .row = 180, .width = 240, .height = 360};
  EXPECT_FALSE(cut(wide));
  EXPECT_FALSE(cut(high));
  for (const double inside : {70.0, 290.0}) {
    Ball ball = wide;
    ball.col = inside;
    EXPECT_FALSE(cut(ball)) << inside;
    ball = high;
    ball.row = inside;
    EXPECT_FALSE(cut(ball)) << inside;
  }
  for (const double outside : {50.0, 190.0}) {
    Ball ball = wide;
    ball.row = outside;
    EXPECT_TRUE(cut(ball)) << outside;
    ball = high;
    ball.col = outside;
    EXPECT_TRUE(cut(ball)) << outside;
  }
}

TEST(RadialProfile, MeansOfRings) {
  const DarkeningMap map = Ball{}.map();
  const RadialProfile profile = radial_profile(map, find_contact(map, 4), 8);
  EXPECT_EQ(profile.levels.size(), 80U);
  EXPECT_NEAR(profile.at(0), 45, 0.1);
  EXPECT_NEAR(profile.at(5), -20, 1e-6);
  // At 2 mm the sag is 4 − √12 = 0.5359 mm: 30 · 0.9641 levels.
  EXPECT_NEAR(profile.at(2), 28.92, 0.1);
  EXPECT_NEAR(profile.shown[40], 1, 0.05);
  EXPECT_LT(profile.shown[79], 0.8) << "rings that the map cuts off show less";
}

// The rings' middles are at 0.05, 0.15 and 0.25 mm.
TEST(RadialProfile, IsReadBetweenTheMiddlesOfRings) {
  const RadialProfile profile{0.1, {40, 30, 10}, {1, 1, 1}};
  EXPECT_DOUBLE_EQ(profile.at(0), 40);
  EXPECT_DOUBLE_EQ(profile.at(0.05), 40);
  EXPECT_NEAR(profile.at(0.08), 37, 1e-9);
  EXPECT_NEAR(profile.at(0.2), 20, 1e-9);
  EXPECT_NEAR(profile.at(0.25), 10, 1e-9);
  EXPECT_DOUBLE_EQ(profile.at(7), 10);
}

TEST(FarFieldDrift, AnEvenShiftIsDrift) {
  DarkeningMap map = Ball{.col = 250, .row = 200, .width = 500, .height = 400}.map();
  const Contact contact = find_contact(map, 4);
  EXPECT_EQ(far_field_drift(map, contact), 0);
  for (float& level : map.levels) level -= 2;
  EXPECT_NEAR(far_field_drift(map, contact), -2, 1e-4);
}

TEST(FarFieldDrift, AnUnevenOrFaintOneIsNot) {
  const Ball ball{.col = 250, .row = 200, .width = 500, .height = 400};
  DarkeningMap map = ball.map();
  const Contact contact = find_contact(map, 4);
  for (std::size_t i = 0; i < map.levels.size(); ++i) {
    map.levels[i] += i % 500 < 250 ? 0.5F : 3.0F;
  }
  EXPECT_EQ(far_field_drift(map, contact), 0);
  map = ball.map();
  for (float& level : map.levels) level += 0.4F;
  EXPECT_EQ(far_field_drift(map, contact), 0);
}

TEST(FarFieldDrift, UnsureWhereTheFarFieldIsOnOneSideOnly) {
  // Tiles of 40 pixels begin at columns 0 to 440 and rows 0 to 360. About the lower left corner all
  // of them are to the right and above, about the upper right one of the tall map all to the left
  // and below; rows taken for columns or columns for rows would find some on either side.
  const DarkeningMap wide{500, 400, 0.05, std::vector<float>(std::size_t{500} * 400, 2)};
  EXPECT_EQ(far_field_drift(wide, {.col = 0, .row = 399, .ball_radius_mm = 1}), 0);
  const DarkeningMap tall{400, 500, 0.05, std::vector<float>(std::size_t{400} * 500, 2)};
  EXPECT_EQ(far_field_drift(tall, {.col = 399, .row = 0, .ball_radius_mm = 1}), 0);
  // Above and below, if nothing to the left, is both sides.
  EXPECT_EQ(far_field_drift(wide, {.col = 0, .row = 200, .ball_radius_mm = 1}), 2);
  EXPECT_EQ(far_field_drift(wide, {.col = 250, .row = 399, .ball_radius_mm = 1}), 2);
}

TEST(FarFieldDrift, UnsureWithoutAFarField) {
  DarkeningMap map = Ball{}.map();
  for (float& level : map.levels) level += 2;
  EXPECT_EQ(far_field_drift(map, find_contact(Ball{}.map(), 4)), 0);
}

}  // namespace
}  // namespace dtact::calibration
