#include "daemon/recon/smoother.hpp"

#include <gtest/gtest.h>

#include <algorithm>
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

/// Pushes an image of one value a row and returns the first column of the result.
std::vector<int> smooth_column(Smoother& smoother, int width, const std::vector<int>& values) {
  RowBuffer in(1, width);
  RowBuffer out(1, width);
  std::vector<int> result;
  smoother.start();
  int pushed = 0;
  for (const int value : values) {
    std::fill_n(in.row(0), width, static_cast<std::int16_t>(value));
    smoother.push(in.row(0));
    ++pushed;
    if (pushed % Smoother::kStrip != 0 && pushed != static_cast<int>(values.size())) continue;
    while (static_cast<int>(result.size()) < smoother.ready()) {
      smoother.take(static_cast<int>(result.size()), out.row(0));
      EXPECT_TRUE(std::all_of(out.row(0), out.row(0) + width,
                              [&](std::int16_t v) { return v == out.row(0)[0]; }));
      result.push_back(out.row(0)[0]);
    }
  }
  return result;
}

TEST(Smoother, ReplicatesTheFirstAndLastRow) {
  Smoother smoother({8192, 4096}, 5, 4);  // 1/4 1/2 1/4
  EXPECT_EQ(smooth_column(smoother, 5, {400, 0, 0, 800}), (std::vector<int>{300, 100, 200, 600}));
}

TEST(Smoother, ReplicatesTheFirstAndLastColumn) {
  Smoother smoother({8192, 4096}, 3, 1);
  RowBuffer in(1, 3);
  RowBuffer out(1, 3);
  std::copy_n(std::vector<std::int16_t>{400, 0, 800}.begin(), 3, in.row(0));
  smoother.start();
  smoother.push(in.row(0));
  ASSERT_EQ(smoother.ready(), 1);
  smoother.take(0, out.row(0));
  EXPECT_EQ(std::vector<int>(out.row(0), out.row(0) + 3), (std::vector<int>{300, 300, 600}));
}

TEST(Smoother, EveryRowComesOutAtEveryHeight) {
  for (int height = 1; height < 60; ++height) {
    Smoother smoother(gaussian_taps(2), 3, height);
    const std::vector<int> constant(static_cast<std::size_t>(height), -1234);
    EXPECT_EQ(smooth_column(smoother, 3, constant), constant) << height;
  }
}

TEST(Smoother, StartForgetsTheImageBefore) {
  Smoother smoother({8192, 4096}, 3, 3);
  (void)smooth_column(smoother, 3, {900, 900, 900});
  EXPECT_EQ(smooth_column(smoother, 3, {0, 0, 0}), (std::vector<int>{0, 0, 0}));
}

}  // namespace
}  // namespace dtact::recon
