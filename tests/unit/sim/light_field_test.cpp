#include "hal/sim/light_field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

std::vector<std::uint16_t> field(const Scene& scene, const Light& light) {
  std::vector<std::uint16_t> out(kPixels);
  LightField(scene).compute(led_levels(light), out);
  return out;
}

constexpr std::size_t kCentre = 60 * 160 + 80;

TEST(LightField, LevelsAreLumaTimesBrightness) {
  Light light;
  EXPECT_EQ(led_levels(light)[0], 65025);
  light.brightness = 100;
  light.leds[3] = {255, 0, 0};
  EXPECT_EQ(led_levels(light)[0], 25500);
  EXPECT_EQ(led_levels(light)[3], 7600);  // 0.299 · 255 = 76
}

TEST(LightField, AllWhiteGivesTheSetLevelAtTheCentre) {
  Scene scene = small_scene("");
  scene.gel.texture = 0;
  EXPECT_NEAR(field(scene, {})[kCentre] / 64.0, scene.light.level, 0.1);
}

TEST(LightField, HalfTheBrightnessIsHalfTheLight) {
  const Scene scene = small_scene("");
  Light half;
  half.brightness = 127;  // 0.498 of full
  const auto full = field(scene, {});
  const auto dim = field(scene, half);
  for (std::size_t i = 0; i < full.size(); ++i) ASSERT_NEAR(dim[i], full[i] * 0.498, 2);
}

TEST(LightField, DarkRingIsBlack) {
  Light dark;
  dark.brightness = 0;
  EXPECT_EQ(field(small_scene(""), dark)[kCentre], 0);
}

TEST(LightField, LedZeroIsAtTheRightAndTheOthersFollowClockwise) {
  const Scene scene = small_scene("");
  const auto only = [&](std::size_t led) {
    Light light;
    light.leds.fill({});
    light.leds[led] = {255, 255, 255};
    return field(scene, light);
  };
  const auto right = only(0);
  EXPECT_GT(right[60 * 160 + 140], right[60 * 160 + 20] + 64);
  const auto below = only(2);
  EXPECT_GT(below[110 * 160 + 80], below[10 * 160 + 80] + 64);
}

// The paper's crop of 24 mm: standard deviation 4.08 grey levels with all LEDs, 16.55 with the most
// lopsided four (their exposure follows the mean, so both are compared as shares of it).
TEST(LightField, IsAsUnevenAsThePapers) {
  const Scene scene = small_scene("");
  const auto unevenness = [&](const Light& light) {
    const auto plane = field(scene, light);
    double sum = 0;
    double squares = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 20; x < 140; ++x) {
        const double v = plane[pixel(x, y)];
        sum += v;
        squares += v * v;
      }
    }
    const double mean = sum / (120 * 120);
    return std::sqrt(squares / (120 * 120) - mean * mean) / mean;
  };
  EXPECT_NEAR(unevenness({}) * 165, 4.08, 1.5);
  Light four;
  for (std::size_t i = 4; i < 8; ++i) four.leds[i] = {};
  EXPECT_NEAR(unevenness(four) * 165, 16.55, 3);
}

TEST(LightField, SidesLightFromLeftAndRight) {
  Scene scene = small_scene("[light]\narrangement = \"sides\"\n");
  scene.gel.texture = 0;
  Light right;
  for (std::size_t i = 4; i < 8; ++i) right.leds[i] = {};
  const auto plane = field(scene, right);
  EXPECT_GT(plane[60 * 160 + 140], plane[60 * 160 + 20] + 64);
  EXPECT_NEAR(field(scene, {})[kCentre] / 64.0, scene.light.level, 0.1);
}

TEST(LightField, MeanOfTwoLightsIsHalfOfEach) {
  Light dark;
  dark.brightness = 0;
  EXPECT_EQ(mean(led_levels({}), led_levels(dark))[5], 32512);
}

}  // namespace
}  // namespace dtact::hal::sim
