#include "daemon/recon/list_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace dtact::recon {
namespace {

/// A list of `levels` grey levels from `first_level` on.
Model model_of(int first_level, int levels, const std::function<double(double)>& um_of_level) {
  Model model;
  model.list.first_q6 = first_level * 64;
  for (int i = 0; i <= levels * 64; ++i) {
    const double level = first_level + i / 64.0;
    model.list.um.push_back(static_cast<std::int16_t>(std::lround(um_of_level(level))));
  }
  model.list.covered_from_q6 = model.list.first_q6;
  model.list.covered_to_q6 = (first_level + levels) * 64;
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

TEST(ListTable, AStraightListStaysWhatItIs) {
  const Model model = model_of(-40, 100, [](double level) { return level < 0 ? 0 : 64 * level; });
  const ListTable table(model.list, model.method);
  const kernels::LookUp list = table.look_up();
  ASSERT_NE(list.knots, nullptr);
  EXPECT_EQ(list.knots->step_bits, 6);
  EXPECT_EQ(list.first_q6, -2560);
  EXPECT_EQ(list.covered_q6, 3840);
  EXPECT_EQ(list.last_q6, 3841);
  for (std::size_t i = 0; i < model.list.um.size(); ++i)
    ASSERT_EQ(list.um[i], model.list.um[i]) << i;
  EXPECT_EQ(list.um[6401], kUntrusted);  // beyond the covered range
  EXPECT_EQ(list.um[6402], kUntrusted);  // what vector kernels mark
}

TEST(ListTable, ACurvedListIsFollowedWithinAMicrometreAndRises) {
  const Model model = model_of(-20, 80, curve);
  const ListTable table(model.list, model.method);
  const kernels::LookUp list = table.look_up();
  ASSERT_NE(list.knots, nullptr);
  double squares = 0;
  for (std::size_t i = 0; i < model.list.um.size(); ++i) {
    ASSERT_EQ(list.um[i], kernels::between(*list.knots, static_cast<int>(i)));
    ASSERT_NEAR(list.um[i], curve(-20 + static_cast<double>(i) / 64), 0.7) << i;
    const double apart = list.um[i] - model.list.um[i];
    squares += apart * apart;
    ASSERT_GE(list.um[i], list.um[i - (i > 0 ? 1 : 0)]) << i;
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(model.list.um.size())), 0.35);
}

TEST(ListTable, OnlyTheCoveredRangeCounts) {
  Model model = model_of(-20, 120, [](double level) { return level > 50 ? 3000 : 20 * level; });
  model.list.covered_to_q6 = 50 * 64;
  const ListTable table(model.list, model.method);
  ASSERT_NE(table.look_up().knots, nullptr);
  EXPECT_EQ(table.look_up().um[70 * 64], 1000);
  EXPECT_EQ(table.look_up().um[70 * 64 + 1], kUntrusted);
}

TEST(ListTable, ALongListHasAKnotEveryOtherLevel) {
  const auto line = [](double level) { return 15 * level; };
  const auto bits = [](const Model& model) {
    return ListTable(model.list, model.method).look_up().knots->step_bits;
  };
  EXPECT_EQ(bits(model_of(-40, 127, line)), 6);
  EXPECT_EQ(bits(model_of(-40, 128, line)), 7);
  EXPECT_EQ(bits(model_of(-40, 254, line)), 7);
  const Model longest = model_of(-100, 255, line);
  EXPECT_EQ(ListTable(longest.list, longest.method).look_up().knots, nullptr);
}

TEST(ListTable, AListThatIsNotStraightBetweenKnotsIsLookedUpEntryByEntry) {
  const auto expect_kept = [](const Model& model) {
    const ListTable table(model.list, model.method);
    EXPECT_EQ(table.look_up().knots, nullptr);
    for (std::size_t i = 0; i < model.list.um.size(); ++i) {
      ASSERT_EQ(table.look_up().um[i], model.list.um[i]) << i;
    }
  };
  // Steps of half a level: 8 µm above and below any line.
  expect_kept(model_of(-20, 80, [](double level) { return 32 * std::floor(2 * level) / 2; }));
  // Deeper than eighths of a micrometre reach.
  expect_kept(model_of(-20, 80, [](double level) { return 70 * level; }));
}

TEST(ListTable, ThePublishedListHasNoKnotsAndHoldsItsEnd) {
  Model model = model_of(0, 40, [](double level) { return 32 * level; });
  model.method = Method::published;
  model.list.covered_to_q6 = 30 * 64;
  const ListTable table(model.list, model.method);
  const kernels::LookUp list = table.look_up();
  EXPECT_EQ(list.knots, nullptr);
  EXPECT_EQ(list.last_q6, 2560);
  EXPECT_EQ(list.um[2560], 1280);
  EXPECT_EQ(list.covered_q6, 1920);
}

TEST(ListTable, AListOfOneEntry) {
  Model model = model_of(-5, 0, [](double) { return -45; });
  EXPECT_EQ(ListTable(model.list, model.method).look_up().um[0], -45);
  EXPECT_EQ(ListTable(model.list, model.method).look_up().um[1], kUntrusted);
}

}  // namespace
}  // namespace dtact::recon
