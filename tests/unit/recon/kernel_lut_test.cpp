#include "daemon/recon/kernel_lut.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace dtact::recon {
namespace {

/// A LUT of `levels` grey levels from `first_level` on.
Model model_of(int first_level, int levels, const std::function<double(double)>& um_of_level) {
  Model model;
  model.lut.first_q6 = first_level * 64;
  for (int i = 0; i <= levels * 64; ++i) {
    const double level = first_level + i / 64.0;
    model.lut.um.push_back(static_cast<std::int16_t>(std::lround(um_of_level(level))));
  }
  model.lut.covered_from_q6 = model.lut.first_q6;
  model.lut.covered_to_q6 = (first_level + levels) * 64;
  return model;
}

double curve(double level) { return level < 0 ? 9 * level : 40 * level - 0.1 * level * level; }

TEST(Between, IsRoundedTwice) {
  kernels::Knots knots;
  knots.at_q3 = {0, 80, 76};  // 0, 10 and 9.5 µm
  knots.rise_q3 = {80, -4};
  EXPECT_EQ(kernels::between(knots, 0), 0);
  EXPECT_EQ(kernels::between(knots, 3), 1);    // 3.75 to 4 eighths, a half, rounded up
  EXPECT_EQ(kernels::between(knots, 2), 0);    // 2.5 to 3 eighths
  EXPECT_EQ(kernels::between(knots, 63), 10);  // 78.75
  EXPECT_EQ(kernels::between(knots, 64), 10);
  EXPECT_EQ(kernels::between(knots, 127), 10);  // 76.06 eighths: a half, rounded up
  EXPECT_EQ(kernels::between(knots, 128), 10);
  knots.step_bits = 7;
  EXPECT_EQ(kernels::between(knots, 64), 5);
}

TEST(KernelLut, AStraightLutStaysWhatItIs) {
  const Model model = model_of(-40, 100, [](double level) { return level < 0 ? 0 : 64 * level; });
  const KernelLut table(model.lut, model.method);
  const kernels::LutView lut = table.view();
  ASSERT_NE(lut.knots, nullptr);
  EXPECT_EQ(lut.knots->step_bits, 6);
  EXPECT_EQ(lut.first_q6, -2560);
  EXPECT_EQ(lut.covered_q6, 3840);
  EXPECT_EQ(lut.last_q6, 3841);
  for (std::size_t i = 0; i < model.lut.um.size(); ++i) ASSERT_EQ(lut.um[i], model.lut.um[i]) << i;
  EXPECT_EQ(lut.um[6401], kUntrusted);  // beyond the covered range
  EXPECT_EQ(lut.um[6402], kUntrusted);  // the mark of the vector kernels
}

TEST(KernelLut, ACurvedLutIsFollowedWithinAMicrometreAndRises) {
  const Model model = model_of(-20, 80, curve);
  const KernelLut table(model.lut, model.method);
  const kernels::LutView lut = table.view();
  ASSERT_NE(lut.knots, nullptr);
  double squares = 0;
  for (std::size_t i = 0; i < model.lut.um.size(); ++i) {
    ASSERT_EQ(lut.um[i], kernels::between(*lut.knots, static_cast<int>(i)));
    ASSERT_NEAR(lut.um[i], curve(-20 + static_cast<double>(i) / 64), 0.7) << i;
    const double apart = lut.um[i] - model.lut.um[i];
    squares += apart * apart;
    ASSERT_GE(lut.um[i], lut.um[i - (i > 0 ? 1 : 0)]) << i;
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(model.lut.um.size())), 0.35);
}

TEST(KernelLut, OnlyTheCoveredRangeCounts) {
  Model model = model_of(-20, 120, [](double level) { return level > 50 ? 3000 : 20 * level; });
  model.lut.covered_to_q6 = 50 * 64;
  const KernelLut table(model.lut, model.method);
  ASSERT_NE(table.view().knots, nullptr);
  EXPECT_EQ(table.view().um[70 * 64], 1000);
  EXPECT_EQ(table.view().um[70 * 64 + 1], kUntrusted);
}

TEST(KernelLut, ALongLutHasAKnotEveryOtherLevel) {
  const auto line = [](double level) { return 15 * level; };
  const auto bits = [](const Model& model) {
    return KernelLut(model.lut, model.method).view().knots->step_bits;
  };
  EXPECT_EQ(bits(model_of(-40, 127, line)), 6);
  EXPECT_EQ(bits(model_of(-40, 128, line)), 7);
  EXPECT_EQ(bits(model_of(-40, 254, line)), 7);
  const Model longest = model_of(-100, 255, line);
  EXPECT_EQ(KernelLut(longest.lut, longest.method).view().knots, nullptr);
}

TEST(KernelLut, ALutThatIsNotStraightBetweenKnotsIsLookedUpEntryByEntry) {
  const auto expect_kept = [](const Model& model) {
    const KernelLut table(model.lut, model.method);
    EXPECT_EQ(table.view().knots, nullptr);
    for (std::size_t i = 0; i < model.lut.um.size(); ++i) {
      ASSERT_EQ(table.view().um[i], model.lut.um[i]) << i;
    }
  };
  // Steps of half a level: 8 µm above and below any line.
  expect_kept(model_of(-20, 80, [](double level) { return 32 * std::floor(2 * level) / 2; }));
  // This depth is beyond the range of eighths of a micrometre.
  expect_kept(model_of(-20, 80, [](double level) { return 70 * level; }));
}

TEST(KernelLut, ThePublishedLutHasNoKnotsAndHoldsItsEnd) {
  Model model = model_of(0, 40, [](double level) { return 32 * level; });
  model.method = Method::published;
  model.lut.covered_to_q6 = 30 * 64;
  const KernelLut table(model.lut, model.method);
  const kernels::LutView lut = table.view();
  EXPECT_EQ(lut.knots, nullptr);
  EXPECT_EQ(lut.last_q6, 2560);
  EXPECT_EQ(lut.um[2560], 1280);
  EXPECT_EQ(lut.covered_q6, 1920);
}

TEST(KernelLut, ALutOfOneEntry) {
  Model model = model_of(-5, 0, [](double) { return -45; });
  EXPECT_EQ(KernelLut(model.lut, model.method).view().um[0], -45);
  EXPECT_EQ(KernelLut(model.lut, model.method).view().um[1], kUntrusted);
}

}  // namespace
}  // namespace dtact::recon
