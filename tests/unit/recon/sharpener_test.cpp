#include "daemon/recon/sharpener.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "daemon/recon/kernels.hpp"

namespace dtact::recon {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(LitRow, IsUnderItsGainAndClampedAndUntrustedPixelsKeepTheirLevel) {
  const std::array<std::int16_t, 5> difference{640, 640, 640, -16320, 16320};
  const std::array<std::int16_t, 5> gain{4096, 6144, 0, 8192, 4100};
  std::array<std::int16_t, 5> level{};
  kernels::lit_row(difference.data(), gain.data(), 5, level.data());
  EXPECT_THAT(level, ElementsAre(640, 960, 640, -16383, 16336));
}

TEST(ShrinkRow, RoundsMeansOfSixteenHalfUp) {
  // Sums 8 and −8 of 16 are half a unit each: 1 and 0. The ends of the range stay what they are.
  std::array<std::array<std::int16_t, 16>, 4> fine{};
  fine[0][0] = 8;
  fine[3][7] = -8;
  for (auto& row : fine) {
    std::fill_n(row.begin() + 8, 4, kernels::kSmoothable);
    std::fill_n(row.begin() + 12, 4, -kernels::kSmoothable);
  }
  const std::int16_t* const rows[] = {fine[0].data(), fine[1].data(), fine[2].data(),
                                      fine[3].data()};
  std::array<std::int16_t, 4> coarse{};
  kernels::shrink_row(rows, 4, coarse.data());
  EXPECT_THAT(coarse, ElementsAre(1, 0, 16383, -16383));
}

TEST(SharpenRow, ReadsTheCoarseGridBilinearly) {
  // With the whole share the wide mean alone is taken off: 0 + 800 − mean.
  const std::array<std::int16_t, 6> near{0, 0, 800, 1600, 1600, 1600};
  const std::array<std::int16_t, 6> other{0, 0, 0, 0, 0, 0};
  const std::vector<std::int16_t> level(8, 800);
  const std::vector<std::int16_t> nothing(8, 0);
  std::vector<std::int16_t> after(8);
  kernels::sharpen_row(level.data(), nothing.data(), nothing.data(),
                       {near.data() + 2, other.data() + 2, kernels::kEighth}, 32767, 8,
                       after.data());
  // 7/8 of 800 and 1600 are 700 and 1400; the grid's columns are 0, 700, 1400, 1400, and pixels lie
  // 3/8, 1/8 before and 1/8, 3/8 behind their middles.
  // (437.5, 612.5 and so on, half a unit rounded up).
  EXPECT_THAT(after, ElementsAre(800 - 438, 800 - 613, 800 - 788, 800 - 963, 800 - 1138, 800 - 1313,
                                 800 - 1400, 800 - 1400));
}

TEST(SharpenRow, SaturatesAtBothEnds) {
  constexpr std::int16_t kMax = kernels::kSmoothable;
  const std::vector<std::int16_t> high(32, kMax);
  const std::vector<std::int16_t> low(32, -kMax);
  const std::vector<std::int16_t> coarse_low(10, -kMax);
  std::vector<std::int16_t> after(32);
  kernels::sharpen_row(high.data(), high.data(), low.data(),
                       {coarse_low.data() + 1, coarse_low.data() + 1, kernels::kEighth}, 9000, 32,
                       after.data());
  EXPECT_THAT(after, testing::Each(kMax));
}

/// A point of 64 levels' light in the middle, scattered and sharpened.
class SharpenerOnAPoint : public testing::Test {
 protected:
  static constexpr int kWidth = 97;
  static constexpr int kHeight = 91;
  static constexpr Scattering kScattering{.narrow_mm = 0.2, .wide_mm = 1.2, .narrow_weight = 0.7};

  static double blurred(int dx, int dy, double mm_per_px) {
    const double r2 = (dx * dx + dy * dy) * mm_per_px * mm_per_px;
    const auto gauss = [&](double sigma) {
      return std::exp(-r2 / (2 * sigma * sigma)) / (2 * M_PI * sigma * sigma) * mm_per_px *
             mm_per_px;
    };
    return kScattering.narrow_weight * gauss(kScattering.narrow_mm) +
           (1 - kScattering.narrow_weight) * gauss(kScattering.wide_mm);
  }
};

TEST_F(SharpenerOnAPoint, EachStepBringsMoreOfThePeakBack) {
  constexpr double kMmPerPx = 0.16;
  constexpr double kPoint = 64 * 1000;
  std::array<int, 3> peak{};
  for (const int steps : {1, 2}) {
    Sharpener sharpener(kScattering, steps, kMmPerPx, kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        sharpener.level(y)[x] =
            static_cast<std::int16_t>(std::lround(kPoint * blurred(x - 48, y - 45, kMmPerPx)));
      }
    }
    peak[0] = sharpener.level(45)[48];
    sharpener.run({0, kHeight, 0, 4});
    peak[static_cast<std::size_t>(steps)] = sharpener.sharpened(45)[48];
    EXPECT_EQ(sharpener.sharpened(5)[5], 0) << "far away nothing is left";
  }
  // A Gaussian of s pixels has 1/(2π s²) on its middle; blurred again, variances add. h is 0.07215
  // there, h∗h 0.02624 and h∗h∗h 0.01312: one step gives 2h − h∗h = 0.1181, two
  // 3h − 3h∗h + h∗h∗h = 0.1509.
  EXPECT_EQ(peak[0], 4618);
  EXPECT_NEAR(peak[1], 7556, 60);
  EXPECT_NEAR(peak[2], 9654, 120);
}

TEST(Sharpener, AnEvenLevelStaysWhatItIs) {
  Sharpener sharpener({.narrow_mm = 0.3, .wide_mm = 1.1, .narrow_weight = 0.5}, 2, 0.2, 50, 37);
  for (int y = 0; y < 37; ++y) std::fill_n(sharpener.level(y), 64, std::int16_t{-777});
  sharpener.run({0, 37, 0, 2});
  for (int y = 0; y < 37; ++y) {
    for (int x = 0; x < 50; ++x) ASSERT_EQ(sharpener.sharpened(y)[x], -777) << x << ", " << y;
  }
}

TEST(Sharpener, TapsSumToOneAndTheCoarseGridTakesItsOwnBlurOff) {
  const Scattering scattering{.narrow_mm = 0.2, .wide_mm = 1.23, .narrow_weight = 0.7};
  const auto sum = [](const std::vector<std::int16_t>& taps) {
    return 2 * std::accumulate(taps.begin() + 1, taps.end(), 0) + taps[0];
  };
  const auto narrow = Sharpener::narrow_taps(scattering, 0.1655);
  const auto wide = Sharpener::wide_taps(scattering, 0.1655);
  EXPECT_EQ(sum(narrow), kernels::kTapOne);
  EXPECT_EQ(sum(wide), kernels::kTapOne);
  EXPECT_EQ(narrow.size(), 5U) << "nine taps";
  // √((1.23/0.1655)² − 15/12 − 16/6)/4 = 1.791 coarse pixels.
  EXPECT_EQ(wide, (std::vector<std::int16_t>{3650, 3124, 1957, 898, 301, 74, 13}));
  EXPECT_EQ(Sharpener::wide_share_q15(scattering), 9830);
  // The means and the interpolation blur more than this already.
  EXPECT_EQ(Sharpener::wide_taps({.narrow_mm = 0.1, .wide_mm = 0.3, .narrow_weight = 1}, 0.2),
            std::vector<std::int16_t>{kernels::kTapOne});
  EXPECT_EQ(Sharpener::wide_share_q15({.narrow_mm = 0.1, .wide_mm = 0.3, .narrow_weight = 0}),
            32767);
}

TEST(Sharpener, SaysWhatItReads) {
  // Wide: 7 coarse pixels at most, even 8; one more for the interpolation.
  const Sharpener sharpener({.narrow_mm = 0.2, .wide_mm = 1.4, .narrow_weight = 0.7}, 2, 0.16, 400,
                            300);
  EXPECT_EQ(sharpener.reach(), 2 * 4 * (8 + 1));
  EXPECT_EQ(sharpener.needed({128, 144, 5, 6}), (MapArea{56, 216, 1, 10}));
  EXPECT_EQ(sharpener.needed({0, 16, 0, 1}), (MapArea{0, 88, 0, 5}));
  EXPECT_EQ(sharpener.needed({288, 300, 12, 13}), (MapArea{216, 300, 8, 13}));
}

TEST(Sharpener, RefusesScatteringThatIsTooWideForTheMap) {
  EXPECT_THAT(
      [] {
        Sharpener(Scattering{.narrow_mm = 0.2, .wide_mm = 7, .narrow_weight = 0.7}, 1, 0.16, 40,
                  30);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("scattering.wide_mm: 7")));
  EXPECT_THAT(
      [] {
        Sharpener(Scattering{.narrow_mm = 2, .wide_mm = 3, .narrow_weight = 0.7}, 1, 0.16, 40, 30);
      },
      ThrowsMessage<std::invalid_argument>(HasSubstr("scattering.narrow_mm: 2")));
}

}  // namespace
}  // namespace dtact::recon
