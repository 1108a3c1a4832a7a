#include "hal/ws2812/dimming.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace dtact::hal::ws2812 {
namespace {

Light white(std::uint8_t brightness) { return {Light::all({255, 255, 255}), brightness}; }

TEST(Ws2812Dimming, GammaOneIsProportional) {
  EXPECT_EQ(dim(white(255), {}).leds[0], (Rgb{255, 255, 255}));
  EXPECT_EQ(dim(white(128), {}).leds[7], (Rgb{128, 128, 128}));
  Light light{Light::all({200, 10, 0}), 128};
  EXPECT_EQ(dim(light, {}).leds[3], (Rgb{100, 5, 0}));  // 100.4, 5.02
}

TEST(Ws2812Dimming, GammaBendsTheBrightnessAndNotTheColours) {
  // 255 · (128/255)^2.2 = 55.98, 255 · (64/255)^2.2 = 12.18; by hand.
  EXPECT_EQ(dim(white(128), {.gamma = 2.2}).leds[0], (Rgb{56, 56, 56}));
  EXPECT_EQ(dim(white(64), {.gamma = 2.2}).leds[0], (Rgb{12, 12, 12}));
  EXPECT_EQ(dim(white(255), {.gamma = 2.2}).leds[0], (Rgb{255, 255, 255}));
  const Light orange{Light::all({200, 100, 0}), 255};
  EXPECT_EQ(dim(orange, {.gamma = 2.2}).leds[0], (Rgb{200, 100, 0}));
}

TEST(Ws2812Dimming, WhatIsOnStaysOnAndWhatIsOffStaysOff) {
  const Light light{Light::all({255, 1, 0}), 1};
  EXPECT_EQ(dim(light, {.gamma = 2.2}).leds[0], (Rgb{1, 1, 0}));
  EXPECT_EQ(dim(white(0), {.gamma = 2.2}).leds[0], (Rgb{0, 0, 0}));
}

TEST(Ws2812Dimming, CurrentFollowsTheDatasheet) {
  EXPECT_NEAR(current_ma(Light::all({255, 255, 255})), 480, 1e-9);
  EXPECT_NEAR(current_ma(Light::all({0, 0, 0})), 8, 1e-9);
  std::array<Rgb, kLedCount> one_red{};
  one_red[2].r = 255;
  EXPECT_NEAR(current_ma(one_red), 27.667, 0.001);  // 8 + 59 / 3
}

TEST(Ws2812Dimming, TheBudgetHolds) {
  const DimmedLight dimmed = dim(white(255), {.budget_ma = 250});
  EXPECT_NEAR(dimmed.scale, 0.5127, 0.0001);  // (250 − 8) / (480 − 8)
  EXPECT_EQ(dimmed.leds[0], (Rgb{130, 130, 130}));
  EXPECT_LE(dimmed.milliamps, 250);
  EXPECT_GT(dimmed.milliamps, 247);
}

TEST(Ws2812Dimming, TheBudgetKeepsTheHue) {
  const Light orange{Light::all({255, 128, 0}), 255};
  const DimmedLight dimmed = dim(orange, {.budget_ma = 120});
  EXPECT_EQ(dimmed.leds[0], (Rgb{120, 60, 0}));  // scale 112 / 236.3
}

TEST(Ws2812Dimming, ABudgetJustEnoughChangesNothing) {
  const DimmedLight dimmed = dim(white(255), {.budget_ma = 480});
  EXPECT_EQ(dimmed.scale, 1);
  EXPECT_EQ(dimmed.leds[0], (Rgb{255, 255, 255}));
}

TEST(Ws2812Dimming, ABudgetForSleepOnlyIsDark) {
  const DimmedLight dimmed = dim(white(255), {.budget_ma = 8});
  EXPECT_EQ(dimmed.leds[0], (Rgb{0, 0, 0}));
}

TEST(Ws2812Dimming, RefusesSettingsThatMakeNoSense) {
  EXPECT_THROW((void)dim(white(1), {.gamma = 0.1}), std::invalid_argument);
  EXPECT_THROW((void)dim(white(1), {.gamma = 6}), std::invalid_argument);
  EXPECT_THROW((void)dim(white(1), {.gamma = std::numeric_limits<double>::quiet_NaN()}),
               std::invalid_argument);
  EXPECT_THROW((void)dim(white(1), {.budget_ma = 7.9}), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::hal::ws2812
