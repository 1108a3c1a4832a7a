#include "clients/calibrate/fit/press_asymmetry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "clients/calibrate/fit/lut_fit.hpp"
#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

using testing::Each;
using testing::HasSubstr;

/// A ball whose darkening must count (1 + a·x + b·y + c·(x² − y²) + d·2xy) times, mm from its
/// middle, to be the ball's.
struct UnevenBall {
  Ball ball = {};
  double a = 0;
  double b = 0;
  double c = 0;
  double d = 0;

  [[nodiscard]] DarkeningMap map() const {
    DarkeningMap map = ball.map();
    for (int y = 0; y < map.height; ++y) {
      for (int x = 0; x < map.width; ++x) {
        const double right = 0.05 * (x - ball.col);
        const double down = 0.05 * (y - ball.row);
        const double gain =
            1 + a * right + b * down + c * (right * right - down * down) + d * 2 * right * down;
        map.levels[static_cast<std::size_t>(y * map.width + x)] /=
            static_cast<float>(std::max(0.2, gain));
      }
    }
    return map;
  }
};

double middle_off_mm(const Ball& ball, const Contact& contact) {
  return 0.05 * std::hypot(contact.col - ball.col, contact.row - ball.row);
}

struct Found {
  Contact contact;
  ChosenAsymmetry chosen;
  SymmetricPress level;
};

Found find(const DarkeningMap& map) {
  const Contact contact = find_contact(map, 4);
  const ChosenAsymmetry chosen = choose_asymmetry(sure_samples(map, contact), 4);
  return {contact, chosen, without_asymmetry(map, contact, chosen.gain)};
}

TEST(PressAsymmetry, ATiltAndTheMiddleThatItPullsAreFound) {
  const UnevenBall press{.a = -0.02, .b = 0.01};
  const Found found = find(press.map());
  ASSERT_EQ(found.chosen.gain.order, AsymmetryOrder::plane);
  EXPECT_NEAR(found.chosen.gain.factors[0], -0.02, 0.001);
  EXPECT_NEAR(found.chosen.gain.factors[1], 0.01, 0.001);
  EXPECT_GT(middle_off_mm(press.ball, found.contact), 0.03) << "the centroid";
  EXPECT_LT(middle_off_mm(press.ball, found.level.contact), 0.005);
}

TEST(PressAsymmetry, AQuadraticIsFound) {
  const UnevenBall press{.a = 0.01, .b = 0, .c = 0.015, .d = -0.01};
  const Found found = find(press.map());
  ASSERT_EQ(found.chosen.gain.order, AsymmetryOrder::quadratic);
  EXPECT_NEAR(found.chosen.gain.factors[0], 0.01, 0.001);
  EXPECT_NEAR(found.chosen.gain.factors[1], 0, 0.001);
  EXPECT_NEAR(found.chosen.gain.factors[2], 0.015, 0.001);
  EXPECT_NEAR(found.chosen.gain.factors[3], -0.01, 0.001);
  EXPECT_LT(middle_off_mm(press.ball, found.level.contact), 0.01);
}

TEST(PressAsymmetry, AnEvenPressUnderNoiseHasNone) {
  DarkeningMap map = Ball{}.map();
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.3F);  // the rest of one grey level after smoothing
  for (float& level : map.levels) level += noise(random);
  const Found found = find(map);
  EXPECT_EQ(found.chosen.gain.order, AsymmetryOrder::none);
  EXPECT_THAT(found.chosen.gain.factors, Each(0.0));
  EXPECT_EQ(found.level.contact.col, found.contact.col);
  EXPECT_EQ(found.level.map.levels, map.levels);
}

// It may as well be a bend of the LUT, and elsewhere on the sensor it would be wrong.
TEST(PressAsymmetry, WhatFallsOffAlikeOnAllSidesIsLeftToTheLut) {
  const Ball ball;
  DarkeningMap map = ball.map();
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double r = 0.05 * std::hypot(x - ball.col, y - ball.row);
      map.levels[static_cast<std::size_t>(y * map.width + x)] *=
          static_cast<float>(1 - 0.015 * std::min(10.0, r * r));
    }
  }
  EXPECT_EQ(find(map).chosen.gain.order, AsymmetryOrder::none);
}

TEST(PressAsymmetry, TheLevelledPressIsTheBallAgain) {
  const UnevenBall press{.a = -0.02, .b = 0.01};
  const Found found = find(press.map());
  // The factor is the gain at the contact's centre.
  const double whole = found.level.map.at(120, 110) / press.ball.level(120, 110);
  for (const auto& [x, y] : {std::pair{85, 110}, {155, 110}, {120, 75}, {120, 145}}) {
    EXPECT_NEAR(found.level.map.at(x, y), whole * press.ball.level(x, y), 0.1) << x << ", " << y;
  }
}

// One and fifty pixels beyond the rim: the polynomial is not extrapolated.
TEST(PressAsymmetry, BeyondTheContactItIsHeld) {
  DarkeningMap map = Ball{}.map();
  const Contact contact = find_contact(map, 4);
  for (float& level : map.levels) level = 1;
  const SymmetricPress level =
      without_asymmetry(map, contact, {.order = AsymmetryOrder::plane, .factors = {0.02, 0, 0, 0}});
  const int rim = static_cast<int>(contact.col + contact.radius_mm / 0.05) + 1;
  EXPECT_NEAR(level.map.at(rim, 110), 1 + 0.02 * contact.radius_mm, 1e-3);
  EXPECT_NEAR(level.map.at(rim + 50, 110), 1 + 0.02 * contact.radius_mm, 1e-3);
}

TEST(PressAsymmetry, TheZeroHangsOnNeitherSectorNorStartNorReach) {
  const UnevenBall press{.a = -0.03, .b = 0.02, .c = 0.02, .d = 0.01};
  const DarkeningMap map = press.map();
  const Found found = find(map);
  const double depth = fit_sag(found.level.map, found.level.contact).depth_mm;
  EXPECT_NEAR(depth, 1.5, 0.01);
  for (const int quarter : {0, 1, 2, 3}) {
    const auto use = [&](int x, int y) {
      return (x > found.level.contact.col) == (quarter % 2 == 0) &&
             (y > found.level.contact.row) == (quarter / 2 == 0);
    };
    EXPECT_NEAR(fit_sag(found.level.map, found.level.contact, use).depth_mm, depth, 0.01);
  }
  Contact start = found.contact;
  start.col += 2;  // a tenth of a millimetre
  const SymmetricPress moved = without_asymmetry(
      map, start, fit_asymmetry(sure_samples(map, start), 4, AsymmetryOrder::quadratic));
  EXPECT_NEAR(fit_sag(moved.map, moved.contact).depth_mm, depth, 0.01);
  for (const double part : {0.8, 0.9, 1.05}) {  // factors of the sure part's radius
    Contact reach = found.level.contact;
    reach.radius_mm *= part;
    EXPECT_NEAR(fit_sag(found.level.map, reach).depth_mm, depth, 0.01);
  }
}

TEST(PressAsymmetry, ATinyContactReportsNothing) {
  const std::vector<PressSample> few(199, {0.1, 0.1, 10});
  const ChosenAsymmetry chosen = choose_asymmetry(few, 4);
  EXPECT_EQ(chosen.gain.order, AsymmetryOrder::none);
  EXPECT_FALSE(chosen.left_out_mm);
  EXPECT_THAT(chosen.describe(), HasSubstr("too small to tell"));
}

TEST(PressAsymmetry, SaysInWordsWhatItChoseAndWhy) {
  const UnevenBall press{.a = -0.02, .b = 0.01};
  EXPECT_THAT(find(press.map()).chosen.describe(),
              HasSubstr(": a plane of 2.2 % a mm was taken off"));
  EXPECT_THAT(find(Ball{}.map()).chosen.describe(), HasSubstr("with a quadratic: it has none"));
}

TEST(PressAsymmetry, SectorsTakeTurns) {
  EXPECT_TRUE(in_even_sector(1, 0.1, 45, 0));
  EXPECT_FALSE(in_even_sector(0.1, 1, 45, 0));
  EXPECT_TRUE(in_even_sector(-0.1, 1, 45, 0));
  EXPECT_FALSE(in_even_sector(1, -0.1, 45, 0));
  EXPECT_FALSE(in_even_sector(1, 0.1, 45, 22.5));
}

}  // namespace
}  // namespace dtact::calibration
