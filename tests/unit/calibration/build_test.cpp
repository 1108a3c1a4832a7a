#include "clients/calibrate/fit/build.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/evaluate.hpp"
#include "tests/unit/calibration/ball.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

BallPress press_of(const Ball& ball) {
  BallPress press;
  press.reference_q8 = ball.reference_image_q8();
  press.frames = {ball.frame()};
  press.ball_radius_mm = 4;
  press.mm_per_px = 0.05;
  return press;
}

TEST(Build, ACalibrationThatReadsItsOwnBall) {
  const BallPress press = press_of(Ball{});
  const Calibration made = build(press);
  EXPECT_EQ(made.model->smoothing_px, 2);
  EXPECT_EQ(made.model->rectify.width, 260);
  const Evaluation e = evaluate(made, press.reference_q8.pixels, press.frames, 4);
  EXPECT_LE(e.mae_mm, 0.01);
  EXPECT_LE(e.half_mae_mm.value_or(1), 0.012);
  EXPECT_GE(e.half_worst_mm.value_or(0), e.half_mae_mm.value_or(1));
  EXPECT_LE(e.sector_mae_mm.value_or(1), 0.012);
  EXPECT_EQ(e.untrusted, 0U);
  EXPECT_NEAR(static_cast<double>(e.pixels), 11600, 300) << "π·(3.04/0.05)²";
  // The sphere is zeroed where the ball is still 0.1 mm deep.
  EXPECT_NEAR(e.offset_mm, 0.1, 0.03);
  EXPECT_NEAR(e.raw_mae_mm, 0.1, 0.03);
}

TEST(Build, SeveralFramesAreAveraged) {
  BallPress press = press_of(Ball{});
  press.frames.push_back(press.frames[0]);
  for (std::uint8_t& v : press.frames[0].pixels) v = static_cast<std::uint8_t>(v + 1);
  for (std::uint8_t& v : press.frames[1].pixels) v = static_cast<std::uint8_t>(v - 1);
  const Evaluation e =
      evaluate(build(press_of(Ball{})), press.reference_q8.pixels, press.frames, 4);
  EXPECT_LE(e.mae_mm, 0.01);
  EXPECT_NEAR(e.contact.peak_levels, 45, 0.5);
}

TEST(Build, ACropMovesTheMapNotTheDepth) {
  BallPress press = press_of(Ball{});
  press.crop = Crop{30, 20, 180, 180};
  const Calibration made = build(press);
  EXPECT_EQ(made.crop_col, 30);
  EXPECT_EQ(made.crop_row, 20);
  EXPECT_EQ(made.model->rectify.width, 180);
  EXPECT_EQ(made.model->rectify.frame_width, 260);
  const Evaluation e = evaluate(made, press.reference_q8.pixels, press.frames, 4);
  EXPECT_NEAR(e.contact.col, 90.25, 0.1);
  EXPECT_NEAR(e.contact.row, 90.5, 0.1);
  EXPECT_LE(e.mae_mm, 0.01);
}

TEST(Build, AGainStaysAtItsPlaceOnTheSurface) {
  BallPress press = press_of(Ball{});
  press.lens = recon::Lens{};
  press.lens->homography = {20, 0, 129.5, 0, 20, 119.5, 0, 0, 1};
  press.crop = Crop{30, 20, 180, 180};  // its middle 0.5 mm left of the lens's place (0, 0)
  press.gain.polynomial = {0.1, 0};
  // 1 + 0.1 (x - 0.5), up to a factor.
  const auto gain = build(press).model->gain.polynomial;
  ASSERT_EQ(gain.size(), 2U);
  EXPECT_NEAR(gain[0], 0.1 / 0.95, 1e-3);
}

// The map's corner is 6.5 and 6 mm from its middle.
TEST(Build, AGainIsNotExtendedToWhatHalvesOrDoublesAtACorner) {
  for (const auto& [per_mm2, kept] :
       {std::pair{-0.011, true}, {-0.012, false}, {0.023, true}, {0.024, false}}) {
    BallPress press = press_of(Ball{});
    press.gain.polynomial = {0, 0, per_mm2, 0, 0};
    const Calibration made = build(press);
    EXPECT_EQ(made.model->gain.polynomial.size(), kept ? 5U : 0U) << per_mm2;
    EXPECT_EQ(gain_left_out(press.gain, made).empty(), kept) << per_mm2;
  }
}

TEST(Build, AnotherPressIsReadToo) {
  const Calibration made = build(press_of(Ball{}));
  const Ball other{.col = 140, .row = 120, .depth_mm = 1.0};
  const std::vector<image::Grey8> frames{other.frame()};
  const Evaluation e = evaluate(made, other.reference_image_q8().pixels, frames, 4);
  EXPECT_LE(e.mae_mm, 0.015);
  EXPECT_EQ(e.untrusted, 0U);
}

TEST(Build, DeeperThanCalibratedIsCountedUntrusted) {
  const Calibration made = build(press_of(Ball{.depth_mm = 1.0}));
  const Ball deeper{.depth_mm = 1.5};
  const std::vector<image::Grey8> frames{deeper.frame()};
  const Evaluation e = evaluate(made, deeper.reference_image_q8().pixels, frames, 4);
  EXPECT_GT(e.untrusted, 1000U);
}

TEST(Build, ADriftedLightIsFollowed) {
  const Ball ball{.col = 250, .row = 200, .width = 500, .height = 400};
  BallPress press = press_of(ball);
  for (std::uint16_t& v : press.reference_q8.pixels) v = static_cast<std::uint16_t>(v + 2 * 256);
  const Calibration made = build(press);
  const Evaluation e = evaluate(made, press.reference_q8.pixels, press.frames, 4);
  EXPECT_NEAR(e.drift_levels, 2, 0.1);
  EXPECT_LE(e.mae_mm, 0.01);
  EXPECT_NEAR(e.contact.peak_levels, 45, 0.5);
}

/// Light that grows by 2 % a millimetre to the right.
void tilt(image::Grey16& reference, image::Grey8& frame) {
  for (std::size_t i = 0; i < frame.pixels.size(); ++i) {
    const double light = 0.8 * (1 + 0.02 * 0.05 * (static_cast<double>(i % 260) - 129.5));
    reference.pixels[i] = static_cast<std::uint16_t>(std::lround(light * reference.pixels[i]));
    frame.pixels[i] = static_cast<std::uint8_t>(std::lround(light * frame.pixels[i]));
  }
}

TEST(Build, ALightThatFallsToOneSideIsSeenInOnePress) {
  BallPress press = press_of(Ball{});
  tilt(press.reference_q8, press.frames[0]);
  Ball beside{.col = 190, .depth_mm = 1.2};  // 3.5 mm away, where the light is 7 % stronger
  image::Grey16 reference = beside.reference_image_q8();
  std::vector<image::Grey8> frames{beside.frame()};
  tilt(reference, frames[0]);

  PressChoices choices;
  const Calibration plain = build(press, &choices);
  EXPECT_FALSE(choices.light) << "it was not asked";
  EXPECT_EQ(plain.model->gain.shape, recon::GainShape::none);
  EXPECT_EQ(choices.press_asymmetry.gain.order, AsymmetryOrder::plane);

  press.may_share_light = true;
  const Calibration shared = build(press, &choices);
  EXPECT_EQ(shared.model->gain.shape, recon::GainShape::uniform);
  EXPECT_EQ(choices.press_asymmetry.gain.order, AsymmetryOrder::none);
  EXPECT_THAT(choices.describe(), HasSubstr("as a share of the light: the share is used"));
  EXPECT_NEAR(read_ball(shared, reference.pixels, frames, 4).offset_mm, 0.1, 0.03);
  EXPECT_GT(read_ball(plain, reference.pixels, frames, 4).offset_mm,
            read_ball(shared, reference.pixels, frames, 4).offset_mm + 0.02);

  BallPress even = press_of(Ball{});
  even.may_share_light = true;
  EXPECT_EQ(build(even, &choices).model->gain.shape, recon::GainShape::none);
  EXPECT_THAT(choices.describe(), HasSubstr("as a share of the light: as it is"));
}

// In the corner the false contact reaches the map's edge; at 20 pixels from it, it does not.
TEST(Build, ADarkPartOfTheMapDoesNotCostThePress) {
  for (const int from : {0, 20}) {
    BallPress press = press_of(Ball{});
    press.may_share_light = true;
    tilt(press.reference_q8, press.frames[0]);
    darken(press.reference_q8, press.frames[0], from, from, 24);
    PressChoices choices;
    const Calibration made = build(press, &choices);
    EXPECT_EQ(made.model->gain.shape, recon::GainShape::none) << from;
    EXPECT_THAT(choices.describe(), HasSubstr("--crop leaves it out")) << from;
    EXPECT_NEAR(read_ball(made, press.reference_q8.pixels, press.frames, 4).contact.col, 120.25, 1)
        << from;
  }
}

TEST(Build, ThePublishedMethodHasNoHalves) {
  BallPress press = press_of(Ball{});
  press.method = recon::Method::published;
  const Evaluation e = evaluate(build(press), press.reference_q8.pixels, press.frames, 4);
  EXPECT_FALSE(e.half_mae_mm.has_value());
  EXPECT_FALSE(e.sector_mae_mm.has_value());
  EXPECT_LE(e.mae_mm, 0.03);
}

void expect_refused(const std::function<void(BallPress&)>& spoil, const char* what) {
  BallPress press = press_of(Ball{});
  spoil(press);
  EXPECT_THAT([&] { (void)build(press); }, ThrowsMessage<std::exception>(HasSubstr(what)));
}

TEST(Build, SaysWhatIsWrongWithTheImages) {
  expect_refused([](BallPress& p) { p.frames.clear(); }, "no image");
  expect_refused([](BallPress& p) { p.frames[0].width = 10; }, "10x240");
  expect_refused([](BallPress& p) { p.ball_radius_mm = 0; }, "radius");
  expect_refused([](BallPress& p) { p.mm_per_px = 51; }, "scale");
  expect_refused([](BallPress& p) { p.crop = Crop{200, 0, 100, 100}; }, "leaves the frame");
  expect_refused([](BallPress& p) { p.crop = Crop{0, 0, 120, 120}; }, "leaves the map");
  expect_refused([](BallPress& p) { p.frames = {Ball{}.reference_image()}; }, "no contact");
  expect_refused(
      [](BallPress& p) {
        for (std::uint16_t& v : p.reference_q8.pixels) v = 255 * 256;
      },
      "white");
  expect_refused(
      [](BallPress& p) {
        for (std::uint8_t& v : p.frames[0].pixels) v = v < 170 ? 0 : v;
      },
      "black");
}

// As --radius-mm and --mm-per-px name them.
TEST(CheckSizes, TheLimitsAreAllowed) {
  for (const double radius_mm : {0.1, 100.0}) EXPECT_NO_THROW(check_sizes(radius_mm, 0.05));
  for (const double radius_mm : {0.09, 100.1}) {
    EXPECT_THROW(check_sizes(radius_mm, 0.05), std::invalid_argument) << radius_mm;
  }
  for (const double mm_per_px : {0.001, 1.0}) EXPECT_NO_THROW(check_sizes(4, mm_per_px));
}

TEST(Evaluate, RefusesAnotherSize) {
  const Calibration made = build(press_of(Ball{}));
  const Ball wide{.width = 300};
  const std::vector<image::Grey8> frames{wide.frame()};
  EXPECT_THROW((void)evaluate(made, wide.reference_image_q8().pixels, frames, 4),
               std::invalid_argument);
  EXPECT_THROW((void)evaluate(made, Ball{}.reference_image_q8().pixels, frames, 4),
               std::invalid_argument);
  EXPECT_THROW((void)evaluate(made, Ball{}.reference_image_q8().pixels, {}, 4),
               std::invalid_argument);
}

}  // namespace
}  // namespace dtact::calibration
