#include "daemon/recon/smoother.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace dtact::recon {
namespace {

TEST(GaussianTaps, SumToExactlyOne) {
  for (const double sigma : {0.3, 0.5, 1.0, 1.4, 2.0, 3.7, 10.0}) {
    const std::vector<std::int16_t> taps = gaussian_taps(sigma);
    const int pairs = std::accumulate(taps.begin() + 1, taps.end(), 0);
    EXPECT_EQ(taps[0] + 2 * pairs, 16384) << sigma;
    EXPECT_TRUE(std::is_sorted(taps.rbegin(), taps.rend())) << sigma;
  }
}

TEST(GaussianTaps, OfOnePixel) {
  // exp(0), exp(−1/2), exp(−2), exp(−9/2) over 2.50595, times 16384, the centre taking
  // the rest.
  EXPECT_EQ(gaussian_taps(1.0), (std::vector<std::int16_t>{6536, 3966, 885, 73}));
}

TEST(GaussianTaps, ZeroMeansNoSmoothing) {
  EXPECT_EQ(gaussian_taps(0), (std::vector<std::int16_t>{16384}));
}

TEST(GaussianTaps, RefusesWhatHasNoKernel) {
  EXPECT_THROW((void)gaussian_taps(-1), std::invalid_argument);
  EXPECT_THROW((void)gaussian_taps(11), std::invalid_argument);
  EXPECT_THROW((void)gaussian_taps(std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

/// Smooths an image of one value a row; every column of the result must be the same.
std::vector<int> smooth_column(Smoother& smoother, int width, const std::vector<int>& values) {
  RowBuffer in(2, width);
  RowBuffer out(2, width);
  const int blocks = (width + vec::kBlock - 1) / vec::kBlock;
  const auto fill = [&](int row, std::size_t y) {
    std::fill_n(in.row(row), width, static_cast<std::int16_t>(values[y]));
  };
  std::vector<int> result;
  int pushed = 0;
  for (int pair = 0; pair < smoother.pairs(); ++pair) {
    for (; pushed < std::min(smoother.pairs(), pair + smoother.reach() + 1); ++pushed) {
      const auto y = 2 * static_cast<std::size_t>(pushed);
      fill(0, y);
      if (y + 1 < values.size()) fill(1, y + 1);
      smoother.push(pushed, in.row(0), in.row(1), 0, blocks);
    }
    smoother.take(pair, out.row(0), out.row(1), 0, blocks);
    for (int i = 0; i < 2 && result.size() < values.size(); ++i) {
      EXPECT_TRUE(std::all_of(out.row(i), out.row(i) + width,
                              [&](std::int16_t v) { return v == out.row(i)[0]; }));
      result.push_back(out.row(i)[0]);
    }
  }
  return result;
}

const std::vector<std::int16_t> kQuarters{8192, 4096};  // 1/4 1/2 1/4

TEST(Smoother, ReplicatesTheFirstAndLastRow) {
  Smoother smoother(kQuarters, 5, 4);
  EXPECT_EQ(smooth_column(smoother, 5, {400, 0, 0, 800}), (std::vector<int>{300, 100, 200, 600}));
}

TEST(Smoother, AnOddHeightEndsWithItsLastRow) {
  Smoother smoother(kQuarters, 5, 3);
  EXPECT_EQ(smoother.pairs(), 2);
  EXPECT_EQ(smooth_column(smoother, 5, {400, 0, 800}), (std::vector<int>{300, 300, 600}));
}

TEST(Smoother, ReplicatesTheFirstAndLastColumn) {
  Smoother smoother(kQuarters, 3, 1);
  RowBuffer in(2, 3);
  RowBuffer out(2, 3);
  std::copy_n(std::vector<std::int16_t>{400, 0, 800}.begin(), 3, in.row(0));
  smoother.push(0, in.row(0), in.row(1), 0, 1);
  smoother.take(0, out.row(0), out.row(1), 0, 1);
  EXPECT_EQ(std::vector<int>(out.row(0), out.row(0) + 3), (std::vector<int>{300, 300, 600}));
}

TEST(Smoother, WhatLiesRightOfTheImageIsItsLastColumn) {
  // The kernel reaches over the edge from the last columns of every width, also from the block
  // before the last; RowBuffer holds what earlier frames left there.
  for (int width = 33; width <= 100; ++width) {
    Smoother smoother(gaussian_taps(2), width, 2);
    RowBuffer in(2, width);
    RowBuffer out(2, width);
    for (int row = 0; row < 2; ++row) {
      std::fill_n(in.row(row), width + smoother.radius(), std::int16_t{9999});
      std::fill_n(in.row(row), width, std::int16_t{640});
    }
    const int blocks = (width + vec::kBlock - 1) / vec::kBlock;
    // A block at a time, as tiles are.
    for (int block = 0; block < blocks; ++block) {
      smoother.push(0, in.row(0), in.row(1), block, block + 1);
      if (block + 1 < blocks) std::fill_n(in.row(0) + width, smoother.radius(), std::int16_t{9999});
    }
    smoother.take(0, out.row(0), out.row(1), 0, blocks);
    EXPECT_EQ(std::vector<int>(out.row(1), out.row(1) + width),
              std::vector<int>(static_cast<std::size_t>(width), 640))
        << width;
  }
}

TEST(Smoother, EveryRowComesOutAtEveryHeight) {
  for (int height = 1; height < 60; ++height) {
    Smoother smoother(gaussian_taps(2), 3, height);
    const std::vector<int> constant(static_cast<std::size_t>(height), -1234);
    EXPECT_EQ(smooth_column(smoother, 3, constant), constant) << height;
  }
}

TEST(Smoother, TheNextImageForgetsTheOneBefore) {
  Smoother smoother(kQuarters, 3, 3);
  (void)smooth_column(smoother, 3, {900, 900, 900});
  EXPECT_EQ(smooth_column(smoother, 3, {0, 0, 0}), (std::vector<int>{0, 0, 0}));
}

TEST(Smoother, ReachCoversTheKernel) {
  EXPECT_EQ(Smoother(gaussian_taps(0), 3, 3).reach(), 0);
  EXPECT_EQ(Smoother(kQuarters, 3, 3).reach(), 1);         // one row up needs the pair above
  EXPECT_EQ(Smoother(gaussian_taps(2), 3, 3).reach(), 3);  // six rows
  EXPECT_EQ(Smoother(gaussian_taps(10), 3, 3).radius(), 30);
}

}  // namespace
}  // namespace dtact::recon
