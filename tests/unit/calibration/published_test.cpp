#include "clients/calibrate/fit/published.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

void expect_circle(const Circle& circle, double col, double row, double radius) {
  EXPECT_NEAR(circle.col, col, 1e-9);
  EXPECT_NEAR(circle.row, row, 1e-9);
  EXPECT_NEAR(circle.radius, radius, 1e-9);
}

TEST(EnclosingCircle, OfFewPoints) {
  expect_circle(enclosing_circle({}), 0, 0, 0);
  expect_circle(enclosing_circle({{7, 9}}), 7, 9, 0);
  expect_circle(enclosing_circle({{0, 0}, {6, 8}}), 3, 4, 5);
}

TEST(EnclosingCircle, OfARightAngleIsItsHypotenuses) {
  expect_circle(enclosing_circle({{0, 0}, {4, 0}, {0, 3}}), 2, 1.5, 2.5);
}

TEST(EnclosingCircle, OfAnAcuteTriangleGoesThroughAllThree) {
  // (0,0), (8,0), (4,8): centre (4, 3), radius 5.
  expect_circle(enclosing_circle({{0, 0}, {8, 0}, {4, 8}}), 4, 3, 5);
}

TEST(EnclosingCircle, OfPointsOnALine) {
  expect_circle(enclosing_circle({{0, 0}, {2, 2}, {6, 6}, {4, 4}}), 3, 3, 4.242640687119285);
}

TEST(EnclosingCircle, OfAFilledSquare) {
  std::vector<Pixel> square;
  for (int y = 0; y <= 10; ++y) {
    for (int x = 0; x <= 10; ++x) square.push_back({x, y});
  }
  expect_circle(enclosing_circle(square), 5, 5, 7.0710678118654755);
}

TEST(PublishedCircle, IsOfTheBallAndNotOfASpeck) {
  const Ball ball{.col = 120, .row = 110};
  image::Grey8 frame = ball.frame();
  frame.pixels[5 * 260 + 5] = 150;
  const Circle circle = published_circle(ball.reference_image(), frame);
  EXPECT_NEAR(circle.col, 120, 1);
  EXPECT_NEAR(circle.row, 110, 1);
  EXPECT_GT(circle.radius, 50);
}

double um_at(const recon::DepthLut& lut, int level) {
  return lut.um[static_cast<std::size_t>(level) * 64];
}

TEST(FitPublished, IsTheMeanDepthLessTheThresholds) {
  const Ball ball{.col = 120, .row = 110};
  const recon::DepthLut lut = fit_published(ball.reference_image(), ball.frame(), 4, 0.05);
  EXPECT_EQ(lut.first_q6, 0);
  EXPECT_EQ(lut.covered_to_q6, 45 * 64);
  EXPECT_EQ(um_at(lut, 0), 0);
  EXPECT_EQ(um_at(lut, 2), 0);
  // More than three whole levels reach to 3.5/30 = 0.117 mm above the flat, r = √(16 − 2.617²) =
  // 3.025 mm, cut to 60 pixels = 3 mm where the ball is 0.146 mm deep: level d reads
  // d/30 − 0.146 mm, and the threshold's entry is held from the first one with pixels, near zero.
  EXPECT_NEAR(um_at(lut, 30), 1000 - 146, 15);
  EXPECT_NEAR(um_at(lut, 45), 1500 - 146, 20);
}

TEST(FitPublished, HasOneValueForEachWholeLevel) {
  const Ball ball;
  const recon::DepthLut lut = fit_published(ball.reference_image(), ball.frame(), 4, 0.05);
  EXPECT_EQ(lut.um[30 * 64 - 32], um_at(lut, 30));
  EXPECT_EQ(lut.um[30 * 64 + 31], um_at(lut, 30));
  EXPECT_NE(lut.um[30 * 64 + 32], um_at(lut, 30));
}

TEST(FitPublished, SaysWhatIsWrong) {
  const Ball ball;
  EXPECT_THAT([&] { (void)fit_published(ball.reference_image(), ball.reference_image(), 4, 0.05); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no contact found")));
  EXPECT_THAT([&] { (void)fit_published(ball.reference_image(), ball.frame(), 2, 0.05); },
              ThrowsMessage<std::runtime_error>(HasSubstr("wider than the ball")));
}

}  // namespace
}  // namespace dtact::calibration
