#include "daemon/recon/upsampler.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "daemon/recon/model.hpp"

namespace dtact::recon {
namespace {

using testing::ElementsAre;

std::vector<std::int16_t> upsampled(Upsampler upsampler, const std::vector<std::int16_t>& coarse) {
  std::vector<std::int16_t> fine(static_cast<std::size_t>(upsampler.width()) *
                                 static_cast<std::size_t>(upsampler.height()));
  upsampler.run(coarse, fine);
  return fine;
}

TEST(Upsampler, ReadsBilinearlyAndHoldsTheEdge) {
  // Middles of fine pixels are at −3/8, −1/8, 1/8, 3/8, … of a coarse one.
  EXPECT_THAT(upsampled(Upsampler(8, 1 * 4, 4, 1), {0, 80}),
              ElementsAre(0, 0, 10, 30, 50, 70, 80, 80,  //
                          0, 0, 10, 30, 50, 70, 80, 80,  //
                          0, 0, 10, 30, 50, 70, 80, 80,  //
                          0, 0, 10, 30, 50, 70, 80, 80));
  EXPECT_THAT(upsampled(Upsampler(8, 4, 4, 2), {0, 80}), ElementsAre(0, 20, 60, 80,  //
                                                                     0, 20, 60, 80));
  EXPECT_THAT(upsampled(Upsampler(4, 8, 4, 2), {0, -80}),
              ElementsAre(0, 0, -20, -20, -60, -60, -80, -80));
}

TEST(Upsampler, FollowsWhatWasLeftOutOnEitherSide) {
  // A quarter's map of ten columns leaves out one before the first pixel and one behind the last.
  // The pixels at half the resolution are at a coarse middle or halfway between two.
  EXPECT_THAT(upsampled(Upsampler(10, 4, 4, 2), {0, 80}), ElementsAre(0, 0, 40, 80, 80,  //
                                                                      0, 0, 40, 80, 80));
  const std::vector<std::int16_t> fine = upsampled(Upsampler(10, 4, 4, 1), {0, 80});
  EXPECT_EQ(std::vector<std::int16_t>(fine.begin(), fine.begin() + 10),
            (std::vector<std::int16_t>{0, 0, 0, 10, 30, 50, 70, 80, 80, 80}));
}

TEST(Upsampler, KeepsAPlane) {
  constexpr int kWidth = 22;   // one column is left out of a quarter's map on either side
  constexpr int kHeight = 25;  // and one row below
  std::vector<std::int16_t> coarse;
  // 8 µm a pixel of the calibration to the right and 16 down, at the middles of coarse pixels.
  for (int y = 0; y < kHeight / 4; ++y) {
    for (int x = 0; x < kWidth / 4; ++x) {
      coarse.push_back(static_cast<std::int16_t>(8 * (1 + 4 * x) + 12 + 16 * 4 * y + 24));
    }
  }
  const std::vector<std::int16_t> fine = upsampled(Upsampler(kWidth, kHeight, 4, 1), coarse);
  for (int y = 2; y < 22; ++y) {
    for (int x = 3; x < 19; ++x) {
      EXPECT_EQ(fine[static_cast<std::size_t>(y * kWidth + x)], 8 * x + 16 * y) << x << ", " << y;
    }
  }
}

TEST(Upsampler, APixelIsAsTrustedAsTheCoarseOneItLiesIn) {
  EXPECT_THAT(upsampled(Upsampler(12, 4, 4, 2), {kUntrusted, 80, 40}),
              ElementsAre(kUntrusted, kUntrusted, 80, 70, 50, 40,  //
                          kUntrusted, kUntrusted, 80, 70, 50, 40));
}

TEST(Upsampler, HoldsTheEndsOfTheRange) {
  EXPECT_THAT(upsampled(Upsampler(8, 4, 4, 2), {16383, -16383}),
              ElementsAre(16383, 8192, -8191, -16383,  //
                          16383, 8192, -8191, -16383));
}

}  // namespace
}  // namespace dtact::recon
