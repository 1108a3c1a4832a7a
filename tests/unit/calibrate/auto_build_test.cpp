// The default calibration: what it takes from the gel's model and what from the press.
#include "clients/calibrate/fit/model/auto_build.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "clients/calibrate/fit/model/model_build.hpp"
#include "tests/unit/calibrate/predicted_press.hpp"

namespace dtact::calibration {
namespace {

using testing::HasSubstr;

BallPresses press_of(const ImaginedView& view) {
  BallPresses set;
  set.reference_q8 = view.reference_image_q8();
  set.presses = {{.name = "ball", .frames = {view.frame()}, .depth_mm = {}}};
  set.ball_radius_mm = view.ball_radius_mm;
  set.mm_per_px = ImaginedView::kMmPerPx;
  return set;
}

/// The light beside the contact falls to the right by `levels_per_mm` grey levels a millimetre; the
/// reference does not have this fall.
BallPresses press_in_fallen_light(const ImaginedView& view, double levels_per_mm) {
  BallPresses set = press_of(view);
  image::Grey8& frame = set.presses[0].frames[0];
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const double beside_mm = (x - view.col) * ImaginedView::kMmPerPx - view.contact_radius_mm;
      const auto at = static_cast<std::size_t>(y * view.width + x);
      frame.pixels[at] -=
          static_cast<std::uint8_t>(std::lround(levels_per_mm * std::max(0.0, beside_mm)));
    }
  }
  return set;
}

/// Depth that a calibration reads in the press's middle, the mean over a quarter of a millimetre.
double deepest_mm(const Calibration& made, const BallPresses& set) {
  const ImaginedView view;
  const std::vector<float> um =
      mean_depth_um(*made.model, set.reference_q8.pixels, set.presses[0].frames);
  double sum = 0;
  int count = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      if (std::hypot(x - view.col, y - view.row) > 4) continue;
      sum += um[static_cast<std::size_t>(y * view.width + x)];
      ++count;
    }
  }
  return 0.001 * sum / count;
}

// One frame's rounding is more than noise for the fit, so this gel does not explain everything.
TEST(AutoBuild, ConstrainsTheLutToAGelThatIsTheSameInAllParts) {
  const BallPresses set = press_of({});
  PressReport report;
  const Calibration made = build_auto(set, {}, report);
  EXPECT_THAT(report.note,
              testing::AllOf(HasSubstr("LUT: what the press shows, at the depth of a gel"),
                             HasSubstr("averages of at least 10 images")));
  EXPECT_TRUE(made.gel);
  PressReport ignored;
  EXPECT_NE(made.model->lut.um, build_from_sphere(set, {}, ignored).model->lut.um);
}

// In squares: how sure the gel's LUT is, and how far the press's own shape is from it.
TEST(AutoBuild, AConstrainedLutIsAsUncertainAsTheGelAndItsDistanceFromIt) {
  const BallPresses set = press_of({});
  PressReport report;
  const recon::Model made = *build_auto(set, {}, report).model;
  const recon::Model gel = *build_model(set, {}).calibration.model;
  ASSERT_EQ(made.uncertainty.size(), gel.uncertainty.size());
  ASSERT_GE(made.uncertainty.size(), 5U);
  double farthest_um = 0;
  for (std::size_t i = 0; i < gel.uncertainty.size(); ++i) {
    const double depth_mm = gel.uncertainty[i].depth_mm;
    EXPECT_EQ(made.uncertainty[i].depth_mm, depth_mm);
    double level = -40;
    while (lut_mm(made.lut, level) < depth_mm && level < 110) level += 1.0 / 64;
    const double apart_um = 1000 * (lut_mm(made.lut, level) - lut_mm(gel.lut, level));
    farthest_um = std::max(farthest_um, std::abs(apart_um));
    EXPECT_NEAR(made.uncertainty[i].error_um, std::hypot(gel.uncertainty[i].error_um, apart_um), 2)
        << depth_mm;
  }
  EXPECT_GT(farthest_um, 10);
}

TEST(AutoBuild, BelievesNoDepthThatChangesWithThePartLookedAt) {
  const BallPresses set = press_in_fallen_light({}, 0.6);
  PressReport report;
  const Calibration made = build_auto(set, {}, report);
  EXPECT_THAT(report.note, HasSubstr("LUT: what the presses show alone: gels fitted to parts"));
  PressReport ignored;
  EXPECT_EQ(made.model->lut.um, build_from_sphere(set, {}, ignored).model->lut.um);
  EXPECT_FALSE(made.gel);
}

TEST(AutoBuild, MeasuredDepthsNeedNoGel) {
  BallPresses set = press_of({});
  const double depth_mm = ImaginedView{}.contact().depth_mm;
  set.presses[0].depth_mm = depth_mm;
  PressReport report;
  const Calibration made = build_auto(set, {}, report);
  PressReport ignored;
  EXPECT_EQ(made.model->lut.um, build_from_sphere(set, {}, ignored).model->lut.um);
  EXPECT_FALSE(made.gel);
  EXPECT_THAT(report.note, HasSubstr("LUT: at the measured depth of"));
  EXPECT_NEAR(deepest_mm(made, set), depth_mm, 0.01);
  // A gauge that reads 0.05 mm more moves the LUT by as much.
  set.presses[0].depth_mm = depth_mm + 0.05;
  EXPECT_NEAR(deepest_mm(build_auto(set, {}, ignored), set), depth_mm + 0.05, 0.01);
}

TEST(AutoBuild, NamesThePressThatIsLeftOutOfTwo) {
  BallPresses set = press_of({});
  image::Grey8 reference_image = set.presses[0].frames[0];
  std::ranges::fill(reference_image.pixels, std::uint8_t{160});
  set.presses.push_back({.name = "nothing", .frames = {reference_image}, .depth_mm = {}});
  PressReport report;
  EXPECT_THAT([&] { (void)build_auto(set, {}, report); },
              testing::ThrowsMessage<std::runtime_error>(testing::AllOf(
                  HasSubstr("at least two"), HasSubstr("left out: nothing: no contact"))));
}

TEST(AutoBuild, RefusesSizesThatCannotBe) {
  BallPresses set = press_of({});
  PressReport report;
  set.ball_radius_mm = -4;
  EXPECT_THAT([&] { (void)build_auto(set, {}, report); },
              testing::ThrowsMessage<std::invalid_argument>(HasSubstr("radius must be 0.1 to")));
  set.ball_radius_mm = 4;
  set.mm_per_px = 0;
  EXPECT_THAT([&] { (void)build_auto(set, {}, report); },
              testing::ThrowsMessage<std::invalid_argument>(HasSubstr("scale must be 0.001 to")));
}

}  // namespace
}  // namespace dtact::calibration
