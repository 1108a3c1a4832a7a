#include "tests/accuracy/thickness/thickness.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/accuracy/thickness/several.hpp"

namespace dtact::thickness {
namespace {

// The paper's finding, section "Measuring fine geometry": thinner gels capture finer geometry,
// and the measuring range is bounded by the gel.
TEST(Thickness, ThinGelsResolveFinerAndThickOnesMeasureDeeper) {
  const Result thin = measure(1.0);
  const Result thick = measure(2.5);
  EXPECT_LT(thin.finest_mm().value(), thick.finest_mm().value());
  EXPECT_LE(thin.finest_mm().value(), 1.5);
  EXPECT_LE(thin.deepest_mm().value(), 0.9);
  EXPECT_GE(thin.deepest_mm().value(), 0.7);
  EXPECT_GE(thick.deepest_mm().value(), 1.8);
}

TEST(Thickness, PitchesBeyondTheFirstUnresolvedOneDoNotCount) {
  Result result;
  result.grooves = {{3, 0.4, 0.3}, {2, 0.4, 0.1}, {1, 0.4, 0.3}};
  EXPECT_EQ(result.finest_mm(), 3);
  result.grooves = {{3, 0.4, 0.1}};
  EXPECT_FALSE(result.finest_mm());
}

TEST(Thickness, DeepestIsTheDeepestMeasured) {
  Result result;
  result.presses = {{0.4, 0.05, 0}, {0.6, 0.05, 0}, {0.8, 0.05, 0.2}};
  EXPECT_EQ(result.deepest_mm(), 0.6);
  EXPECT_EQ(to_csv({result}).find("thickness_mm,kind"), 0U);
}

// A gel that is 8 % thicker 8 mm to the right.
TEST(SeveralPresses, ATaperedGelGetsAPlane) {
  const SeveralPresses tapered =
      measure_several({.taper_x = 0.01}, 21, {.calibration_presses = 16, .test_presses = 4});
  EXPECT_NE(tapered.gain.find("plane"), std::string::npos) << tapered.gain;
  EXPECT_LT(tapered.several_mm, 0.02);
  EXPECT_EQ(tapered.ratios.size(), 4U);
  EXPECT_NE(to_markdown({tapered}).find("1.0 %/mm thicker to the right"), std::string::npos);
}

}  // namespace
}  // namespace dtact::thickness
