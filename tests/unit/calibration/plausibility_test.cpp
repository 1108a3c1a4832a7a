#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "clients/calibrate/fit/evaluate.hpp"
#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A healthy press: a ball of 4 mm radius, whose sphere is 1.401 mm deep in a contact of 3.04 mm.
Evaluation healthy() {
  Evaluation press;
  press.contact = {.radius_mm = 3.04, .ball_radius_mm = 4};
  press.offset_mm = 0.1;
  press.mae_mm = 0.01;
  press.pixels = 10000;
  return press;
}

TEST(Doubts, NoneAboutAHealthyPress) { EXPECT_THAT(doubts_about(healthy()), IsEmpty()); }

TEST(Doubts, ASphereThatIsNotWhereTheLutHasIt) {
  Evaluation press = healthy();
  press.offset_mm = 0.21;
  EXPECT_THAT(doubts_about(press), IsEmpty());
  press.offset_mm = -0.21;
  EXPECT_THAT(doubts_about(press), IsEmpty());
  const auto named =
      ElementsAre(AllOf(HasSubstr("0.23 mm"), HasSubstr("the scale"), HasSubstr("radius"),
                        HasSubstr("place"), HasSubstr("light"), HasSubstr("0.22")));
  press.offset_mm = 0.23;
  EXPECT_THAT(doubts_about(press), named);
  press.offset_mm = -0.23;
  EXPECT_THAT(doubts_about(press), named);
}

TEST(Doubts, AShapeThatIsNoBall) {
  Evaluation press = healthy();
  press.mae_mm = 0.125;  // 8.9 % of 1.401
  EXPECT_THAT(doubts_about(press), IsEmpty());
  press.mae_mm = 0.127;  // 9.1 %
  EXPECT_THAT(doubts_about(press),
              ElementsAre(AllOf(HasSubstr("0.13 mm off a sphere of 4 mm"), HasSubstr("9 %"))));
  // A light press: 0.46 mm of sphere in 1.87 mm.
  press.contact.radius_mm = 1.87;
  press.mae_mm = 0.049;
  EXPECT_THAT(doubts_about(press), IsEmpty());
  press.mae_mm = 0.051;
  EXPECT_THAT(doubts_about(press), ElementsAre(HasSubstr("not the shape of a ball")));
}

TEST(Doubts, AContactPartlyInDimLight) {
  Evaluation press = healthy();
  press.dim = 0.09;
  EXPECT_THAT(doubts_about(press), IsEmpty());
  press.dim = 0.11;
  EXPECT_THAT(doubts_about(press),
              ElementsAre(AllOf(HasSubstr("11 %"), HasSubstr("less than half of the light"))));
}

TEST(Doubts, AContactInTheDark) {
  Evaluation press = healthy();
  press.unseen = 190;
  EXPECT_THAT(doubts_about(press), IsEmpty());
  press.unseen = 400;
  EXPECT_THAT(doubts_about(press), ElementsAre(HasSubstr("4 % of the contact is too dark")));
}

recon::DepthLut list_of(double um_a_level) {
  recon::DepthLut lut;
  for (int q6 = 0; q6 <= 40 * 64; ++q6) {
    lut.um.push_back(static_cast<std::int16_t>(std::lround(um_a_level * q6 / 64)));
  }
  lut.covered_to_q6 = 40 * 64;
  return lut;
}

TEST(Doubts, ASlopeThatNoSensorHas) {
  for (const double um : {12.1, 20.0, 32.0, 64.0, 80.0, 119.9}) {
    EXPECT_THAT(doubts_about(list_of(um)), IsEmpty()) << um;
  }
  EXPECT_THAT(doubts_about(list_of(11.9)), ElementsAre(HasSubstr("a grey level is 11.9 um")));
  EXPECT_THAT(doubts_about(list_of(121)), ElementsAre(HasSubstr("a grey level is 121.0 um")));
}

BallPress scaled_press_of(const Ball& ball, double mm_per_px = 0.05, double radius_mm = 4) {
  BallPress press;
  press.reference_q8 = ball.reference_image_q8();
  press.frames = {ball.frame()};
  press.mm_per_px = mm_per_px;
  press.ball_radius_mm = radius_mm;
  return press;
}

std::vector<std::string> doubts_of(const BallPress& press) {
  return doubts_about(build(press), press);
}

TEST(Doubts, OfBuiltCalibrations) {
  for (const double depth_mm : {0.4, 0.7, 1.0, 1.5, 1.9}) {
    EXPECT_THAT(doubts_of(scaled_press_of(Ball{.depth_mm = depth_mm})), IsEmpty()) << depth_mm;
  }
  // The scale's decimal point is at the wrong place.
  EXPECT_THAT(doubts_of(scaled_press_of(Ball{}, 0.005)),
              Contains(HasSubstr("a grey level is 0.3 um")));
  EXPECT_THAT(doubts_of(scaled_press_of(Ball{}, 0.05, 40)),
              Contains(HasSubstr("a grey level is 2.9 um")));
  // 1.9 mm deep, the contact's radius is 3.4 mm, more than a ball of 3.2 mm has.
  EXPECT_THAT(doubts_of(scaled_press_of(Ball{.depth_mm = 1.9}, 0.05, 3.2)),
              Contains(HasSubstr("LUT and sphere disagree")));
  EXPECT_THAT(doubts_of(scaled_press_of(Ball{.depth_mm = 1.9}, 0.0552)),
              Contains(HasSubstr("LUT and sphere disagree")));
}

TEST(Doubts, OfAPublishedLut) {
  BallPress press = scaled_press_of(Ball{});
  press.method = recon::Method::published;
  EXPECT_THAT(doubts_of(press), IsEmpty());
  press.mm_per_px = 0.005;
  EXPECT_THAT(doubts_of(press), Contains(HasSubstr("a grey level is 0.2 um")));
}

TEST(Doubts, OfAPressHalfInTheDark) {
  // The right half is dark in both images.
  BallPress press = scaled_press_of(Ball{});
  for (int y = 0; y < 240; ++y) {
    for (int x = 130; x < 260; ++x) {
      const auto at = static_cast<std::size_t>(y) * 260 + static_cast<std::size_t>(x);
      press.reference_q8.pixels[at] = 4 * 256;
      press.frames[0].pixels[at] = 4;
    }
  }
  EXPECT_THAT(doubts_of(press), Contains(HasSubstr("too dark to be seen")));
}

// A corner has a quarter of the light: 625 of 62400 pixels, the nearest at (24, 24), the ball at
// (120.25, 110.5).
TEST(DimPart, IsReportedWhereNobodySaidTheGain) {
  BallPresses set;
  set.reference_q8 = Ball{}.reference_image_q8();
  set.presses = {{"ball", {Ball{}.frame()}, {}}};
  set.ball_radius_mm = 4;
  set.mm_per_px = 0.05;
  BallPress press = scaled_press_of(Ball{});
  EXPECT_EQ(dim_part_of(build(press), set), "");
  for (int y = 0; y < 25; ++y) {
    for (int x = 0; x < 25; ++x) {
      const auto at = static_cast<std::size_t>(y) * 260 + static_cast<std::size_t>(x);
      set.reference_q8.pixels[at] = 50 * 256;
      set.presses[0].frames[0].pixels[at] = 50;
    }
  }
  press.reference_q8 = set.reference_q8;
  press.frames = set.presses[0].frames;
  Calibration made = build(press);
  EXPECT_THAT(dim_part_of(made, set), AllOf(HasSubstr("1 % of the map"), HasSubstr("from 6.5 mm"),
                                            HasSubstr("less than half of the light")));
  EXPECT_THAT(doubts_about(made, set), IsEmpty()) << "it is to be known, not refused";
  set.gain_specified = true;
  EXPECT_EQ(dim_part_of(made, set), "");
  set.gain_specified = false;
  auto shared = std::make_shared<recon::Model>(*made.model);
  shared->gain.shape = recon::GainShape::uniform;
  made.model = std::move(shared);
  EXPECT_EQ(dim_part_of(made, set), "");
}

TEST(Doubts, OfSeveralPressesNameThePress) {
  BallPresses set;
  set.reference_q8 = Ball{}.reference_image_q8();
  for (const double depth_mm : {0.5, 0.75, 1.0, 1.5}) {
    set.presses.push_back(
        {fmt::format("press of {}", depth_mm), {Ball{.depth_mm = depth_mm}.frame()}, {}});
  }
  set.presses.push_back({"nothing", {Ball{.depth_mm = 0}.frame()}, {}});
  set.ball_radius_mm = 4;
  set.mm_per_px = 0.05;
  const Calibration made = build(set);
  EXPECT_THAT(doubts_about(made, set), IsEmpty());
  // A press that this LUT did not see and that is half in the dark is found by its name.
  image::Grey8 half = Ball{.depth_mm = 1.2}.frame();
  for (std::size_t i = 0; i < half.pixels.size(); ++i) {
    if (i % 260 >= 120) half.pixels[i] = 200;
  }
  set.presses.push_back({"half", {half}, {}});
  EXPECT_THAT(doubts_about(made, set), Contains(HasSubstr("half: the press has not the shape")));
}

// Before: the press was left out of the LUT, and its shape then refused the good ones.
TEST(Doubts, NoneOfAPressThatIsLeftOut) {
  BallPresses set;
  set.reference_q8 = Ball{}.reference_image_q8();
  for (const double depth_mm : {0.5, 0.75, 1.0, 1.5}) {
    set.presses.push_back(
        {fmt::format("press of {}", depth_mm), {Ball{.depth_mm = depth_mm}.frame()}, {}});
  }
  image::Grey8 black = Ball{.depth_mm = 1.2}.frame();
  for (auto& pixel : black.pixels) pixel = pixel < 190 ? 0 : pixel;
  set.presses.push_back({"black", {black}, {}});
  set.ball_radius_mm = 4;
  set.mm_per_px = 0.05;
  PressReport report;
  const Calibration made = build(set, &report);
  EXPECT_THAT(report.left_out, Contains(HasSubstr("black: the ball's image is black")));
  EXPECT_THAT(doubts_about(made, set), IsEmpty());
}

}  // namespace
}  // namespace dtact::calibration
