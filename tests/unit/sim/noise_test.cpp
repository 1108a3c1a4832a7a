#include "hal/sim/noise.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace dtact::hal::sim {
namespace {

std::vector<std::uint8_t> noisy(const Noise& noise, std::uint64_t sequence, std::uint32_t row,
                                std::uint16_t grey_q6, std::size_t n) {
  const std::vector<std::uint16_t> grey(n, grey_q6);
  std::vector<std::int16_t> amplitude(n);
  std::vector<std::uint8_t> out(n);
  noise.amplitude(grey, amplitude);
  noise.add(sequence, row, grey, amplitude, out.data());
  return out;
}

TEST(Noise, HasTheDeviationAskedFor) {
  const Noise noise(1, 0.6, 0.8);
  double sum = 0;
  double squares = 0;
  double neighbours = 0;
  double count = 0;
  for (std::uint32_t row = 0; row < 200; ++row) {
    const auto line = noisy(noise, 7, row, 160 * 64, 1000);
    for (std::size_t i = 0; i < line.size(); ++i) {
      const double v = line[i] - 160.0;
      sum += v;
      squares += v * v;
      count += 1;
      if (i > 0) neighbours += v * (line[i - 1] - 160.0);
    }
  }
  EXPECT_NEAR(sum / count, 0, 0.01);
  EXPECT_NEAR(squares / count, 0.36 + 0.64 + 1.0 / 12, 0.02);  // rounding adds a twelfth
  EXPECT_NEAR(neighbours / count, 0, 0.02);
}

TEST(Noise, ShotNoiseFallsWithTheRootOfTheGrey) {
  const Noise noise(1, 0, 2);
  double squares = 0;
  for (std::uint32_t row = 0; row < 100; ++row) {
    for (const std::uint8_t v : noisy(noise, 1, row, 40 * 64, 1000)) {
      squares += (v - 40.0) * (v - 40.0);
    }
  }
  EXPECT_NEAR(squares / 1e5, 1.0 + 1.0 / 12, 0.03);  // 4 · 40/160
}

TEST(Noise, WithoutNoiseItOnlyRounds) {
  const Noise noise(1, 0, 0);
  EXPECT_EQ(noisy(noise, 3, 4, 100 * 64 + 31, 1)[0], 100);
  EXPECT_EQ(noisy(noise, 3, 4, 100 * 64 + 32, 1)[0], 101);
  EXPECT_EQ(noisy(noise, 3, 4, 0, 1)[0], 0);
  EXPECT_EQ(noisy(noise, 3, 4, 255 * 64, 1)[0], 255);
}

TEST(Noise, DependsOnSeedSequenceAndRowAndNothingElse) {
  const auto first = noisy(Noise(1, 1, 0), 1, 1, 6400, 64);
  EXPECT_EQ(noisy(Noise(1, 1, 0), 1, 1, 6400, 64), first);
  EXPECT_NE(noisy(Noise(2, 1, 0), 1, 1, 6400, 64), first);
  EXPECT_NE(noisy(Noise(1, 1, 0), 2, 1, 6400, 64), first);
  EXPECT_NE(noisy(Noise(1, 1, 0), 1, 2, 6400, 64), first);
}

}  // namespace
}  // namespace dtact::hal::sim
