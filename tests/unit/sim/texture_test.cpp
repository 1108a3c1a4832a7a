#include <gtest/gtest.h>

#include <cmath>

#include "hal/sim/light_field.hpp"

namespace dtact::hal::sim {
namespace {

double mean_product(const Texture& texture, double apart_mm) {
  double sum = 0;
  int count = 0;
  for (int row = 0; row < 150; ++row) {
    for (int column = 0; column < 150; ++column) {
      const double x = 0.131 * column - 10;
      const double y = 0.131 * row - 10;
      sum += texture.at({x, y}) * texture.at({x + apart_mm, y});
      ++count;
    }
  }
  return sum / count;
}

TEST(Texture, IsAsStrongAndAsWideAsAsked) {
  const Texture texture(0.01, 0.2);
  EXPECT_NEAR(std::sqrt(mean_product(texture, 0)), 0.01, 0.0005);
  EXPECT_GT(mean_product(texture, 0.1), 0.7e-4);
  EXPECT_NEAR(mean_product(texture, 1), 0, 0.05e-4);
}

TEST(Texture, BelongsToItsPlaceAndHasNoSteps) {
  const Texture texture(0.01, 0.2);
  EXPECT_EQ(texture.at({1.234, -3.21}), Texture(0.01, 0.2).at({1.234, -3.21}));
  for (int i = 0; i < 200; ++i) {
    const double x = 0.01 * i - 1;
    EXPECT_NEAR(texture.at({x, 0.5}), texture.at({x + 1e-6, 0.5}), 1e-6);
  }
}

TEST(Texture, OfNoStrengthIsNone) { EXPECT_EQ(Texture(0, 0.2).at({1, 2}), 0); }

}  // namespace
}  // namespace dtact::hal::sim
