#include "clients/calibrate/fit/press_set.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/fit/chain_fit.hpp"
#include "tests/unit/calibration/ball.hpp"
#include "tests/unit/calibration/lut_reading.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// Rings of a 4 mm ball `depth_mm` deep out to `reach_mm`, where darkening = 30 · depth.
SagProfile rings(double depth_mm, double reach_mm) {
  SagProfile profile;
  for (double r = 0; r < reach_mm; r += 0.05) {
    const double sag = 4 - std::sqrt(16 - r * r);
    profile.rings.push_back({30 * (depth_mm - sag), sag, 10 + r});
  }
  return profile;
}

TEST(FitChain, FindsDepthsThatNobodyMeasured) {
  const ChainFit fit = fit_chain({rings(0.4, 1.2), rings(0.9, 1.8), rings(1.4, 2.2)});
  EXPECT_TRUE(fit.gaps.empty());
  EXPECT_NEAR(fit.depth_mm[0], 0.4, 0.003);
  EXPECT_NEAR(fit.depth_mm[1], 0.9, 0.003);
  EXPECT_NEAR(fit.depth_mm[2], 1.4, 0.003);
  for (const Knot& knot : fit.knots) EXPECT_NEAR(knot.depth_mm, knot.level / 30, 0.003);
}

TEST(FitChain, AMeasuredDepthTiesTheChain) {
  // The rings say 1.4 mm if no darkening is no depth; a gauge says 1.5.
  SagProfile measured = rings(1.4, 2.2);
  measured.depth_mm = 1.5;
  const ChainFit fit = fit_chain({rings(0.9, 1.8), measured});
  EXPECT_NEAR(fit.depth_mm[1], 1.5, 0.001);
  EXPECT_NEAR(fit.depth_mm[0], 1.0, 0.02);
}

TEST(FitChain, NeverFalls) {
  // 24 to 30 grey levels measured at 0.8 to 1.0 mm, 31 to 36 at 0.5 to 0.7 mm: no LUT can read this
  // response.
  SagProfile deep = rings(1.0, 1.2);
  deep.depth_mm = 1.0;
  SagProfile darker = rings(1.2, 1.2);
  darker.depth_mm = 0.7;
  const ChainFit fit = fit_chain({deep, darker});
  for (std::size_t k = 1; k < fit.knots.size(); ++k) {
    EXPECT_GE(fit.knots[k].depth_mm, fit.knots[k - 1].depth_mm) << k;
  }
  EXPECT_GT(fit.knots.back().depth_mm, 0.8);
}

TEST(FitChain, NamesWhatNoPressShows) {
  const ChainFit shallow = fit_chain({rings(1.0, 0.9), rings(1.4, 1.2)});
  ASSERT_EQ(shallow.gaps.size(), 2U);
  EXPECT_EQ(shallow.gaps[0].from_mm, 0);
  EXPECT_NEAR(shallow.gaps[0].to_mm, 0.9, 0.1);
}

TEST(FitChain, WhatOnePressShowsIsNoGapBehindAnother) {
  // 0.25 to 0.45 mm, 0.56 to 1.4, within that 0.68 to 0.7, and 1.43 to 1.6.
  const ChainFit fit =
      fit_chain({rings(0.45, 1.3), rings(1.4, 2.5), rings(0.7, 0.5), rings(1.6, 1.2)});
  EXPECT_TRUE(fit.gaps.empty());
}

TEST(FitChain, NeedsADarkRing) {
  EXPECT_THROW((void)fit_chain({}), std::invalid_argument);
  EXPECT_THROW((void)fit_chain({SagProfile{.rings = {{-1, 0, 1}}, .depth_mm = {}}}),
               std::invalid_argument);
}

BallPresses set_of(const std::vector<Ball>& balls) {
  BallPresses set;
  set.reference_q8 = balls.front().reference_image_q8();
  for (std::size_t i = 0; i < balls.size(); ++i) {
    set.presses.push_back({"press " + std::to_string(i + 1), {balls[i].frame()}, {}});
  }
  set.ball_radius_mm = 4;
  set.mm_per_px = 0.05;
  return set;
}

TEST(BuildFromPresses, ReadsALinearResponse) {
  PressReport report;
  const Calibration made =
      build(set_of({Ball{.depth_mm = 0.5}, Ball{.depth_mm = 0.75},
                    Ball{.col = 130, .row = 125, .depth_mm = 1.0}, Ball{.depth_mm = 1.5}}),
            &report);
  for (const double level : {0.0, 8.0, 15.0, 30.0, 40.0}) {
    EXPECT_NEAR(um_at(made.model->lut, level), level / 30 * 1000, 15) << level;
  }
  ASSERT_EQ(report.presses.size(), 4U);
  EXPECT_NEAR(report.presses[2].depth_mm, 1.0, 0.015);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none) << "the light is even";
  EXPECT_FALSE(made.model->uncertainty.empty());
  // A ring of 20 levels makes 0.15 x 20 x 33.3 um, another ball 5 %.
  for (const auto& row : made.model->uncertainty) {
    EXPECT_GT(row.error_um, std::hypot(50 * row.depth_mm, 100) - 2);
    EXPECT_LT(row.error_um, std::hypot(50 * row.depth_mm, 100) + 5);
  }
}

/// The set's images with light and darkening that fall from left to right.
void shade(BallPresses& set, double by = 0.3) {
  const auto light = [by](std::size_t i) { return 1 - by * static_cast<double>(i % 260) / 259; };
  for (std::size_t i = 0; i < set.reference_q8.pixels.size(); ++i) {
    set.reference_q8.pixels[i] = static_cast<std::uint16_t>(51200 * light(i));
  }
  for (auto& press : set.presses) {
    for (std::size_t i = 0; i < press.frames[0].pixels.size(); ++i) {
      auto& pixel = press.frames[0].pixels[i];
      pixel = static_cast<std::uint8_t>(std::lround(pixel * light(i)));
    }
  }
}

TEST(BuildFromPresses, UnevenLightPaysForAGain) {
  BallPresses set = set_of({Ball{.depth_mm = 0.5}, Ball{.col = 90, .row = 90, .depth_mm = 1.0},
                            Ball{.depth_mm = 0.7}, Ball{.col = 165, .row = 140, .depth_mm = 1.0},
                            Ball{.depth_mm = 1.5}});
  shade(set);
  PressReport report;
  const Calibration made = build(set, &report);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::uniform);
  EXPECT_LT(report.gains[1].error_mm, 0.5 * report.gains[0].error_mm);
  EXPECT_NEAR(report.presses[1].depth_mm, 1.0, 0.03);
  EXPECT_NEAR(report.presses[3].depth_mm, 1.0, 0.03);
}

// Grey levels that were cut off would make the LUT too shallow.
TEST(BuildFromPresses, LeavesOutWhatIsWhiteOrBlack) {
  const std::vector<Ball> balls = {Ball{.depth_mm = 0.5}, Ball{.depth_mm = 0.75},
                                   Ball{.depth_mm = 1.0}};
  BallPresses white = set_of(balls);
  std::ranges::fill(white.reference_q8.pixels, std::uint16_t{255 * 256});
  for (auto& press : white.presses) {  // of a light of 260 levels
    for (auto& pixel : press.frames[0].pixels) {
      pixel = static_cast<std::uint8_t>(std::min(255, pixel + 60));
    }
  }
  EXPECT_THAT([&] { (void)build(white); },
              ThrowsMessage<std::runtime_error>(HasSubstr("white at the contact")));
  BallPresses black = set_of(balls);
  for (auto& press : black.presses) {
    for (auto& pixel : press.frames[0].pixels) pixel = pixel < 190 ? 0 : pixel;
  }
  EXPECT_THAT([&] { (void)build(black); },
              ThrowsMessage<std::runtime_error>(HasSubstr("black at the contact")));
}

// A contact needs 8 grey levels. The shallower press has 8.4, but 7.7 as a share of the light.
TEST(BuildFromPresses, APressThatIsTooFaintAsAShareOfTheLightCostsNoChain) {
  BallPresses set = set_of({Ball{.col = 60, .depth_mm = 0.31}, Ball{.col = 110, .depth_mm = 0.55}});
  shade(set);
  PressReport report;
  EXPECT_EQ(build(set, &report).model->gain.shape, recon::GainShape::none);
  EXPECT_EQ(report.presses.size(), 2U);
  EXPECT_THAT(report.note, HasSubstr("fewer than two"));
}

/// Eight presses at different places and depths.
std::vector<Ball> eight_balls() {
  return {
      Ball{.col = 95, .row = 100, .depth_mm = 0.5},  Ball{.col = 165, .row = 95, .depth_mm = 0.6},
      Ball{.col = 130, .row = 140, .depth_mm = 0.7}, Ball{.col = 98, .row = 135, .depth_mm = 0.8},
      Ball{.col = 160, .row = 138, .depth_mm = 0.9}, Ball{.col = 128, .row = 100, .depth_mm = 1.0},
      Ball{.col = 100, .row = 118, .depth_mm = 1.1}, Ball{.col = 155, .row = 118, .depth_mm = 1.2}};
}

TEST(BuildFromPresses, AnEvenSensorGetsNoGain) {
  PressReport report;
  const Calibration made = build(set_of(eight_balls()), &report);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none);
  EXPECT_TRUE(made.model->gain.polynomial.empty());
  // Presses within 1.8 mm do not determine a quadratic at the map's corners, 9 mm away.
  ASSERT_EQ(report.gains.size(), 4U);
  EXPECT_EQ(report.gains[0].name, "none");
  EXPECT_TRUE(report.gains[0].chosen);
  EXPECT_EQ(report.gains[3].name, "share of the light, plane");
}

TEST(BuildFromPresses, NoGainIsTriedThatThePressesCannotJudge) {
  // A plane has two factors and needs five presses, a quadratic five and needs eight.
  const std::vector<Ball> balls = eight_balls();
  const auto tried = [&](std::size_t presses) {
    PressReport report;
    (void)build(set_of({balls.begin(), balls.begin() + static_cast<std::ptrdiff_t>(presses)}),
                &report);
    std::vector<std::string> names;
    for (const auto& gain : report.gains) names.push_back(gain.name);
    return names;
  };
  EXPECT_THAT(tried(4), testing::ElementsAre("none", "share of the light"));
  EXPECT_THAT(tried(5), testing::ElementsAre("none", "share of the light", "plane",
                                             "share of the light, plane"));
}

TEST(BuildFromPresses, AGainThatIsBetterByChanceIsNotTaken) {
  std::vector<Ball> balls = eight_balls();
  balls.resize(4);
  BallPresses set = set_of(balls);
  for (std::size_t p = 0; p < set.presses.size(); ++p) {
    for (auto& pixel : set.presses[p].frames[0].pixels) {
      pixel =
          static_cast<std::uint8_t>(std::lround(200 - (p % 2 == 0 ? 1.03 : 0.97) * (200 - pixel)));
    }
  }
  shade(set, 0.08);
  PressReport report;
  const Calibration made = build(set, &report);
  EXPECT_LT(report.gains[1].error_mm, report.gains[0].error_mm);
  EXPECT_LT(report.gains[0].error_mm - report.gains[1].error_mm, report.gains[0].standard_error_mm);
  EXPECT_TRUE(report.gains[0].chosen);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none);
}

TEST(BuildFromPresses, AThickerSidePaysForAPlane) {
  BallPresses set = set_of(eight_balls());
  // The light is the same everywhere, but darkening grows by 6 % a millimetre to the right.
  for (auto& press : set.presses) {
    for (std::size_t i = 0; i < press.frames[0].pixels.size(); ++i) {
      const double x_mm = 0.05 * (static_cast<double>(i % 260) - 129.5);
      auto& pixel = press.frames[0].pixels[i];
      pixel = static_cast<std::uint8_t>(std::lround(200 - (200 - pixel) * (1 + 0.06 * x_mm)));
    }
  }
  PressReport report;
  const Calibration made = build(set, &report);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none);
  ASSERT_EQ(made.model->gain.polynomial.size(), 2U);
  // 1 / (1 + 0.06 x) over ±1.7 mm.
  EXPECT_NEAR(made.model->gain.polynomial[0], -0.06, 0.01);
  EXPECT_NEAR(made.model->gain.polynomial[1], 0, 0.005);
  EXPECT_LT(report.gains[2].error_mm, 0.5 * report.gains[0].error_mm);
  // Within a contact the gain is that of its centre, and a plane is not 1 / (1 + 0.06 x).
  EXPECT_NEAR(report.presses[0].depth_mm, 0.5, 0.03);
  EXPECT_NEAR(report.presses[7].depth_mm, 1.2, 0.03);
}

TEST(LeaveEachOut, FreesOnlyTheDepthOfThePress) {
  const auto press = [](double depth_mm, double slope) {
    PressRings rings{.all = {}, .seen_mm = 2, .ball_radius_mm = 4};
    for (double r = 0; r < 2; r += 0.05) {
      const double sag = 4 - std::sqrt(16 - r * r);
      rings.all.rings.push_back({30 * slope * (depth_mm - sag), sag, 10});
    }
    return rings;
  };
  const ChainFit lut = chain_presses({press(0.6, 1), press(0.9, 1), press(1.3, 1)}).fit;
  // A press that darkens by a tenth more than the LUT: the offset goes into its depth, and the
  // sphere's shape does not fit.
  const LeftOutResidual same = residual_of(press(0.8, 1), lut);
  const LeftOutResidual other = residual_of(press(0.8, 1.1), lut);
  EXPECT_LT(same.mean_error_mm(), 0.001);
  EXPECT_NEAR(same.rings.front().depth_mm, 0.8, 0.002);
  EXPECT_NEAR(other.rings.front().depth_mm, 0.88, 0.02);
  // A tenth of the sag, whose mean distance from its mean is about a quarter of its range: the
  // sure contact reaches 1.2 mm, a sag of 0.18 mm.
  EXPECT_NEAR(other.mean_error_mm(), 0.1 * 0.18 / 4, 0.002);
  // The offset counts where the depth was measured.
  PressRings measured = press(0.8, 1.1);
  measured.all.depth_mm = 0.8;
  EXPECT_NEAR(residual_of(measured, lut).mean_error_mm(), 0.08, 0.015);
}

TEST(LeaveEachOut, KnowsNothingOfThePressThatIsLeftOut) {
  const auto press = [](double depth_mm) {
    return PressRings{.all = rings(depth_mm, 2), .seen_mm = 2, .ball_radius_mm = 4};
  };
  const LeaveOneOut out = leave_one_out({press(0.6), press(0.9), press(1.3)});
  ASSERT_EQ(out.without.size(), 3U);
  // A LUT ends with the deepest press that made it, at 30 levels a millimetre.
  EXPECT_NEAR(out.without[0].knots.back().level, 39, 0.1);
  EXPECT_NEAR(out.without[2].knots.back().level, 27, 0.1);
}

TEST(GainTerms, CountFromTheMapsMiddle) {
  SettledPress press;
  press.map = {261, 101, 0.1, {}};
  press.contact.col = 150;
  press.contact.row = 80;
  const std::vector<double> terms = gain_terms(press, 5);
  ASSERT_EQ(terms.size(), 5U);
  for (const auto& [term, expected] : {std::pair{0, 2.0}, {1, 3.0}, {2, 4.0}, {3, 6.0}, {4, 9.0}}) {
    EXPECT_NEAR(terms[static_cast<std::size_t>(term)], expected, 1e-9) << term;
  }
}

TEST(BuildFromPresses, APressThatOneGainCannotSeeIsLeftOut) {
  // The second darkens by 9 levels where the light is three quarters: 7 as it is, but 8 of the mean
  // light.
  BallPresses set =
      set_of({Ball{.depth_mm = 0.5}, Ball{.col = 185, .depth_mm = 0.33}, Ball{.depth_mm = 0.7},
              Ball{.col = 90, .row = 90, .depth_mm = 1.0}, Ball{.depth_mm = 1.5}});
  shade(set);
  PressReport report;
  (void)build(set, &report);
  EXPECT_THAT(report.left_out, testing::ElementsAre(HasSubstr("press 2")));
  ASSERT_EQ(report.presses.size(), 4U);
  EXPECT_EQ(report.presses[1].name, "press 3");
  EXPECT_NEAR(report.presses[1].depth_mm, 0.7, 0.03);
}

TEST(BuildFromPresses, ADarkPartOfTheMapCostsNoPress) {
  BallPresses set = set_of({Ball{.depth_mm = 0.5}, Ball{.depth_mm = 0.75},
                            Ball{.col = 130, .row = 125, .depth_mm = 1.0}, Ball{.depth_mm = 1.5}});
  for (auto& press : set.presses) darken(set.reference_q8, press.frames[0], 0, 0, 24);
  PressReport report;
  const Calibration made = build(set, &report);
  EXPECT_THAT(report.left_out, testing::IsEmpty());
  ASSERT_EQ(report.presses.size(), 4U);
  EXPECT_NEAR(report.presses[2].depth_mm, 1.0, 0.015);
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::none);
  EXPECT_THAT(report.note, AllOf(HasSubstr("press 1: the contact"), HasSubstr("--crop")));
}

// Presses that differ by a tenth either way determine a LUT to a tenth over the root of their
// number.
TEST(BuildFromPresses, StatesHowFarThePressesThatMadeTheLutDiffer) {
  std::vector<Ball> balls;
  for (const double depth_mm : {0.5, 0.8, 1.1, 1.4}) {
    balls.push_back(Ball{.depth_mm = depth_mm});
    balls.push_back(Ball{.depth_mm = depth_mm});
  }
  BallPresses set = set_of(balls);
  for (std::size_t p = 0; p < set.presses.size(); ++p) {
    const double slope = p % 2 == 0 ? 0.9 : 1.1;
    for (auto& pixel : set.presses[p].frames[0].pixels) {
      const int level = std::max(0, 200 - pixel);  // without the ring, whose light is in doubt
      pixel = static_cast<std::uint8_t>(std::lround(200 - slope * level));
    }
  }
  const auto rows = build(set).model->uncertainty;
  ASSERT_GE(rows.size(), 6U);
  // And 5 % for objects of another shape.
  for (const auto& row : rows) {
    EXPECT_NEAR(row.error_um, std::hypot(50, 100 / std::sqrt(8)) * row.depth_mm, 5);
  }
}

TEST(BuildFromPresses, SaysWhatToPressNext) {
  EXPECT_THAT(
      [] { (void)build(set_of({Ball{.depth_mm = 1.4}, Ball{.depth_mm = 1.5}})); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("no press shows indentations from 0.00 to"),
                                              HasSubstr("press the ball about"))));
  EXPECT_THROW((void)build(set_of({Ball{}})), std::runtime_error);
  BallPresses with_nothing = set_of({Ball{}, Ball{.depth_mm = 0.0}});
  EXPECT_THAT([&] { (void)build(with_nothing); },
              ThrowsMessage<std::runtime_error>(HasSubstr("press 2")));
}

TEST(BuildFromPresses, ARefusalForAGapNamesThePressThatWasLeftOut) {
  // The first would close the gap, but its 7 grey levels are not a contact.
  EXPECT_THAT(
      [] {
        (void)build(set_of({Ball{.depth_mm = 0.23}, Ball{.depth_mm = 0.8}, Ball{.depth_mm = 0.8}}));
      },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("no press shows indentations from 0.00 to"),
                                              HasSubstr("; left out: press 1: no contact found"))));
}

TEST(BuildFromPresses, TwoLightPressesAreEnough) {
  PressReport report;
  (void)build(set_of({Ball{.depth_mm = 0.45}, Ball{.col = 130, .depth_mm = 0.8}}), &report);
  ASSERT_EQ(report.presses.size(), 2U);
  EXPECT_NEAR(report.presses[0].depth_mm, 0.45, 0.02);
  EXPECT_NEAR(report.presses[1].depth_mm, 0.8, 0.02);
}

TEST(BuildRegression, FindsOneSlopeWhereThereIsOne) {
  const Calibration made =
      build_regression(set_of({Ball{.depth_mm = 1.0}, Ball{.col = 90, .row = 90, .depth_mm = 1.2},
                               Ball{.col = 165, .row = 140, .depth_mm = 0.8}}));
  EXPECT_EQ(made.model->gain.shape, recon::GainShape::radial);
  // Few presses: the line still sees that slopes are lower at the circles' rims.
  EXPECT_NEAR(made.model->gain.per_mm, 0, 0.1);
  // The circle is at three levels, 0.1 mm deep, and the sphere is zeroed there.
  EXPECT_GT(um_at(made.model->lut, 30), 800);
  EXPECT_LT(um_at(made.model->lut, 30), 1000);
  EXPECT_EQ(um_at(made.model->lut, 0), 0);
}

TEST(BuildRegression, CountsTheDistanceFromTheCentreItIsGiven) {
  BallPresses set = set_of({Ball{.depth_mm = 1.0}, Ball{.col = 90, .row = 90, .depth_mm = 1.2},
                            Ball{.col = 165, .row = 140, .depth_mm = 0.8}});
  // A grey level is deeper by a fifth for each millimetre from a place 3 mm right of the middle.
  for (auto& press : set.presses) {
    for (std::size_t i = 0; i < press.frames[0].pixels.size(); ++i) {
      const double x_mm = 0.05 * (static_cast<double>(i % 260) - 129.5) - 3;
      const std::size_t row = i / 260;
      const double y_mm = 0.05 * (static_cast<double>(row) - 119.5);
      auto& pixel = press.frames[0].pixels[i];
      pixel = static_cast<std::uint8_t>(
          std::lround(200 - 1.5 * (200 - pixel) / (1 + 0.2 * std::hypot(x_mm, y_mm))));
    }
  }
  EXPECT_NEAR(build_regression(set, 3, 0).model->gain.per_mm, 0.2, 0.15);
}

TEST(BuildRegression, NeedsPressesInSeveralPlaces) {
  EXPECT_THROW((void)build_regression(set_of({Ball{.depth_mm = 0.0}})), std::runtime_error);
}

}  // namespace
}  // namespace dtact::calibration
