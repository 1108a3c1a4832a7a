// dtact-calibrate reprocess: depth of a recorded frame by another calibration.
#include "clients/calibrate/reprocess/depth_reprocessor.hpp"

#include <gtest/gtest.h>

#include "tests/fakes/scattering_toy.hpp"
#include "tests/fakes/stepped_loop.hpp"

namespace dtact::reprocess {
namespace {

/// A frame of the toy, pressed by 0.8 mm, whose map was recorded with these settings.
v1::Frame recorded(std::uint32_t decimation, std::uint32_t sharpen_steps) {
  v1::Frame frame;
  frame.set_monotonic_ns(1);
  frame.mutable_depth()->set_decimation(decimation);
  frame.mutable_depth()->set_sharpen_steps(sharpen_steps);
  return frame;
}

v1::Frame remade(DepthReprocessor& remaker, v1::Frame frame) {
  const fakes::ToyFrame pressed({.press_mm = 0.8});
  remaker.remake(pressed.view(), frame);
  return frame;
}

// The toy's map has 144 x 104 pixels of 0.2 mm; levels are sharpened at a quarter of that.
TEST(DepthReprocessor, SharpensWhatWasSharpened) {
  DepthReprocessor remaker(fakes::scattering_toy_calibration(15));
  remaker.set_reference(fakes::toy_reference_q8());
  const v1::Frame plain = remade(remaker, recorded(1, 0));
  EXPECT_EQ(plain.depth().sharpen_steps(), 0U);
  EXPECT_EQ(plain.depth().made_decimation(), 0U);
  double deepest_mm = plain.contact().deepest_mm();
  for (const std::uint32_t steps : {1U, 2U}) {
    const v1::Frame sharp = remade(remaker, recorded(1, steps));
    EXPECT_EQ(sharp.depth().sharpen_steps(), steps);
    EXPECT_EQ(sharp.depth().made_decimation(), 4U);
    EXPECT_EQ(sharp.depth().decimation(), 1U);
    EXPECT_EQ(sharp.depth().width(), 144U);
    EXPECT_DOUBLE_EQ(sharp.depth().mm_per_px(), 0.2);
    // Sharpening restores the peak that scattering lowers, the more the more steps.
    EXPECT_GT(sharp.contact().deepest_mm(), 1.02 * deepest_mm) << steps;
    deepest_mm = sharp.contact().deepest_mm();
  }
  const v1::Frame quarter = remade(remaker, recorded(4, 2));
  EXPECT_EQ(quarter.depth().width(), 36U);
  EXPECT_EQ(quarter.depth().made_decimation(), 0U) << "no coarser than itself";
  EXPECT_EQ(remaker.unsharpened(), 0U);
}

TEST(DepthReprocessor, CountsWhatTheCalibrationCannotSharpen) {
  DepthReprocessor remaker(fakes::toy_calibration());
  remaker.set_reference(fakes::toy_reference_q8());
  (void)remade(remaker, recorded(2, 0));
  EXPECT_EQ(remaker.unsharpened(), 0U);
  const v1::Frame plain = remade(remaker, recorded(2, 1));
  EXPECT_EQ(plain.depth().sharpen_steps(), 0U);
  EXPECT_EQ(plain.depth().width(), 72U);
  EXPECT_EQ(remaker.unsharpened(), 1U);
}

// Before: as if the contact had been whole where it is deeper than the calibration covers.
TEST(DepthReprocessor, IsAsUncertainAsTheDaemonBeyondTheCalibration) {
  const fakes::ToyScene deep{.press_mm = 3};
  fakes::SteppedLoop loop;
  loop.begin(fakes::toy_calibration());
  ASSERT_TRUE(loop.until_fresh());
  loop.camera.scene = deep;
  loop.step(4);
  ASSERT_TRUE(loop.frame->health.has(pipeline::Health::beyond_calibration));
  DepthReprocessor remaker(fakes::toy_calibration());
  remaker.set_reference(fakes::toy_reference_q8());
  v1::Frame frame = recorded(1, 0);
  remaker.remake(fakes::ToyFrame(deep).view(), frame);
  EXPECT_NEAR(frame.depth().uncertainty_um() / loop.frame->uncertainty_um, 1, 0.1);
}

// A map of a size that the daemon does not serve is made at full resolution.
TEST(DepthReprocessor, TakesNoResolutionThatThereIsNot) {
  DepthReprocessor remaker(fakes::toy_calibration());
  remaker.set_reference(fakes::toy_reference_q8());
  EXPECT_EQ(remade(remaker, recorded(3, 0)).depth().decimation(), 1U);
  EXPECT_EQ(remade(remaker, recorded(0, 0)).depth().width(), 144U);
}

}  // namespace
}  // namespace dtact::reprocess
