#include "clients/calibrate/fit/lut_uncertainty.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/calibrate/fit/press_set.hpp"
#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

/// The press of a Ball: 33.3 um a grey level, a ring of 20 grey levels.
SettledPress settled(const Ball& ball, double lighter = 0) {
  SettledPress press;
  press.map = ball.map();
  for (float& level : press.map.levels) {
    if (level < 0) level += static_cast<float>(lighter);
  }
  press.contact = find_contact(press.map, 4);
  return press;
}

/// 33.3 um a grey level and `offset_um`.
recon::DepthLut line(double offset_um = 0) {
  recon::DepthLut lut;
  for (int q6 = 0; q6 <= 60 * 64; ++q6) {
    lut.um.push_back(static_cast<std::int16_t>(std::lround(1000.0 / 30 * q6 / 64 + offset_um)));
  }
  lut.covered_to_q6 = 60 * 64;
  return lut;
}

TEST(UncertaintyOfZero, IsALevelAndAShareOfTheRing) {
  const std::vector<SettledPress> presses{settled(Ball{.depth_mm = 1.2})};
  const auto rows = uncertainty_of_zero(line(), presses);
  ASSERT_EQ(rows.size(), 6U) << "0.2 mm each to 1.2 mm";
  EXPECT_NEAR(rows[0].depth_mm, 0.15, 0.03) << "from the contact's edge at 3 levels, 0.1 mm";
  EXPECT_NEAR(rows[5].depth_mm, 1.1, 0.03);
  // 33.3 um times the root of 1 + (0.15 * 20)^2.
  for (const auto& row : rows) EXPECT_NEAR(row.error_um, 105.4, 2) << row.depth_mm;
  // A ring of 5 levels: 33.3 um times the root of 1 + 0.75^2.
  const std::vector<SettledPress> fainter{settled(Ball{.depth_mm = 1.2}, 15)};
  EXPECT_NEAR(uncertainty_of_zero(line(), fainter)[3].error_um, 41.7, 1);
}

TEST(UncertaintyOfZero, CountsHowFarTheLutIsFromTheSphere) {
  const std::vector<SettledPress> presses{settled(Ball{.depth_mm = 1.2}, 15)};
  // The root of 41.7^2 + 100^2.
  for (const auto& row : uncertainty_of_zero(line(-100), presses)) {
    EXPECT_NEAR(row.error_um, 108.3, 2) << row.depth_mm;
  }
}

// The sphere is at the gauge's depth, and the ring does not contribute.
TEST(UncertaintyOfZero, OfAMeasuredDepthIsAGreyLevel) {
  const std::vector<SettledPress> presses{settled(Ball{.depth_mm = 1.2})};
  for (const auto& row : uncertainty_of_zero(line(), presses, 1.2)) {
    EXPECT_NEAR(row.error_um, 33.3, 2) << row.depth_mm;
  }
  // The root of 33.3^2 + 100^2.
  EXPECT_NEAR(uncertainty_of_zero(line(), presses, 1.3)[3].error_um, 105.4, 2);
}

TEST(UncertaintyOfZero, SaysNothingWithoutAPress) {
  EXPECT_TRUE(uncertainty_of_zero(line(), {}).empty());
}

TEST(UncertaintyOfZero, EveryMethodStatesIt) {
  BallPress press;
  press.reference_q8 = Ball{}.reference_image_q8();
  press.frames = {Ball{}.frame()};
  press.mm_per_px = 0.05;
  press.ball_radius_mm = 4;
  const auto own = build(press).model->uncertainty;
  press.method = recon::Method::published;
  const auto published = build(press).model->uncertainty;
  BallPresses set;
  set.reference_q8 = press.reference_q8;
  set.presses = {{"a", {Ball{.depth_mm = 1.0}.frame()}, {}},
                 {"b", {Ball{.col = 90, .row = 90, .depth_mm = 1.2}.frame()}, {}}};
  set.ball_radius_mm = 4;
  set.mm_per_px = 0.05;
  const auto regression = build_regression(set).model->uncertainty;
  ASSERT_EQ(own.size(), 8U);
  ASSERT_EQ(published.size(), 7U);
  ASSERT_EQ(regression.size(), 5U);
  // The zero's 105 um, and the fit's residual; the published LUTs have their zero at 0.1 to 0.15 mm
  // of depth.
  EXPECT_NEAR(own[4].error_um, 105, 4);
  EXPECT_NEAR(published[4].error_um, 178, 15);
  EXPECT_GT(regression[3].error_um, 125);
}

}  // namespace
}  // namespace dtact::calibration
