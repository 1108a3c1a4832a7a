#include "daemon/recon/flat_field_gain.hpp"

#include <gtest/gtest.h>

#include <stdexcept>
#include <utility>
#include <vector>

namespace dtact::recon {
namespace {

// Three columns and one of padding, two rows; 64 is one grey level.
const PlaneShape kShape{.width = 3, .height = 2, .stride = 4, .mm_per_px = 2};
const std::vector<std::int16_t> kPlane{6400, 12800, 6400, 7, 6400, 12800, 100, 7};

std::vector<std::int16_t> applied(const FlatFieldGain& gain) {
  std::vector<std::int16_t> plane = kPlane;
  apply(gain, kShape, plane);
  return plane;
}

TEST(FlatFieldGain, NoneLeavesThePlane) { EXPECT_EQ(applied({}), kPlane); }

TEST(FlatFieldGain, UniformIsTheMeanOfWhatIsNotDark) {
  // (3 · 6400 + 2 · 12800) / 5; the pixel of 1.6 levels does not count.
  EXPECT_EQ(applied({.shape = GainShape::uniform}),
            (std::vector<std::int16_t>{8960, 8960, 8960, 7, 8960, 8960, 8960, 7}));
}

TEST(FlatFieldGain, RadialGrowsWithTheDistance) {
  // From the upper left pixel: 0, 2 and 4 mm in its row, 2, √8 and √20 below.
  const auto plane =
      applied({.shape = GainShape::radial, .centre_x_mm = -2, .centre_y_mm = -1, .per_mm = 0.25});
  EXPECT_EQ(plane, (std::vector<std::int16_t>{6400, 19200, 12800, 7, 9600, 21851, 212, 7}));
}

TEST(FlatFieldGain, APolynomialIsOnTopOfTheShape) {
  // Places: x −2, 0, 2 mm; y −1 in the first row, 1 in the second.
  EXPECT_EQ(applied({.polynomial = {0.25, -0.5}}),
            (std::vector<std::int16_t>{6400, 19200, 12800, 7, 0, 6400, 100, 7}));
  // 1 + x²/4 − xy/4: 1.5, 1, 2.5 and 2.5, 1, 1.5.
  EXPECT_EQ(applied({.shape = GainShape::uniform, .polynomial = {0, 0, 0.25, -0.25, 0}}),
            (std::vector<std::int16_t>{13440, 8960, 22400, 7, 22400, 8960, 13440, 7}));
}

TEST(FlatFieldGain, Saturates) {
  EXPECT_EQ(applied({.shape = GainShape::radial, .centre_x_mm = -900, .per_mm = 1})[0], INT16_MAX);
  EXPECT_EQ(applied({.shape = GainShape::radial, .centre_x_mm = -900, .per_mm = -1})[0], 0);
}

TEST(FlatFieldGain, IsTheSameFromAnotherPlaceUpToAFactor) {
  FlatFieldGain gain{.shape = GainShape::radial, .centre_x_mm = 1, .centre_y_mm = 2, .per_mm = 0.1};
  gain.polynomial = {0.01, -0.02, 0.003, 0.001, -0.002};
  const FlatFieldGain there = moved(gain, 3, -4);
  EXPECT_EQ(there.centre_x_mm, -2);
  EXPECT_EQ(there.centre_y_mm, 6);
  const double factor = gain.polynomial_at(3, -4);
  for (const auto& [x, y] : {std::pair{0., 0.}, {1.5, 0.}, {-2., 3.}}) {
    EXPECT_NEAR(there.polynomial_at(x, y), gain.polynomial_at(x + 3, y - 4) / factor, 1e-12);
  }
  gain.polynomial = {-0.5, 0};
  EXPECT_THROW((void)moved(gain, 2, 0), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::recon
