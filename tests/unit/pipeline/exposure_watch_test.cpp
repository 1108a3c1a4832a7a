#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>

#include "daemon/pipeline/reference/image_watch.hpp"
#include "tests/fakes/stepped_loop.hpp"

namespace dtact::pipeline {
namespace {

using fakes::SteppedLoop;
using fakes::toy_calibration;

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr LightSeen kNotSeen;

/// Whether a light that is brighter by one share while another is lost is reported after a second.
/// `before`: how much the light had changed without contact.
bool is_reported(double brighter, double lost, double before = 0) {
  ExposureWatch watch;
  watch.look({.from = LightSeen::From::all, .change = before}, std::nullopt, 0);
  watch.look(kNotSeen, LightCompared{.brighter = brighter, .lost = lost}, kSecondNs);
  watch.look(kNotSeen, LightCompared{.brighter = brighter, .lost = lost}, 2 * kSecondNs);
  return watch.follows();
}

TEST(ExposureWatchLimits, ACoverTakesAFiftiethAndTheRestBrightensByAHundredth) {
  EXPECT_TRUE(is_reported(0.01, 0.02));
  EXPECT_FALSE(is_reported(0.0099, 0.02));
  EXPECT_FALSE(is_reported(0.01, 0.0199));
}

// A cover of a fifth leaves four fifths: a quarter more keeps the mean.
TEST(ExposureWatchLimits, TheRestBrightensByAboutWhatKeepsTheMean) {
  EXPECT_FALSE(is_reported(0.099, 0.2));
  EXPECT_TRUE(is_reported(0.101, 0.2));  // 0.4 of a quarter
  EXPECT_TRUE(is_reported(0.99, 0.2));   // 4 times a quarter
  EXPECT_FALSE(is_reported(1.01, 0.2));
}

TEST(ExposureWatchLimits, WhatWasBrighterWithoutContactDoesNotCount) {
  EXPECT_TRUE(is_reported(0.07, 0.02, 0.05));
  EXPECT_FALSE(is_reported(0.055, 0.02, 0.05));
  EXPECT_FALSE(is_reported(0.005, 0.02, -0.05))
      << "a dimmer light may be a press of the whole field";
}

TEST(ExposureWatchLimits, ItBeginsWithinFiveSecondsOfNoContact) {
  const auto begun_at = [](std::int64_t first_ns) {
    ExposureWatch watch;
    watch.look({.from = LightSeen::From::all, .change = 0}, std::nullopt, 0);
    for (const std::int64_t after_ns : {std::int64_t{0}, kSecondNs, 2 * kSecondNs}) {
      watch.look(kNotSeen, LightCompared{.brighter = 0.1, .lost = 0.1}, first_ns + after_ns);
    }
    return watch.follows();
  };
  EXPECT_TRUE(begun_at(5 * kSecondNs - 1));
  EXPECT_FALSE(begun_at(5 * kSecondNs));
}

TEST(ExposureWatchLimits, ItLastsASecondWithoutAnInterruption) {
  constexpr LightCompared kBrighter{.brighter = 0.1, .lost = 0.1};
  ExposureWatch watch;
  watch.look({.from = LightSeen::From::all, .change = 0}, std::nullopt, 0);
  watch.look(kNotSeen, kBrighter, 100);
  watch.look(kNotSeen, LightCompared{}, 200);
  watch.look(kNotSeen, kBrighter, 300);
  watch.look(kNotSeen, std::nullopt, 400);  // not compared: no interruption
  watch.look(kNotSeen, kBrighter, kSecondNs + 299);
  EXPECT_FALSE(watch.follows());
  watch.look(kNotSeen, kBrighter, kSecondNs + 300);
  EXPECT_TRUE(watch.follows());
  watch.look(kNotSeen, LightCompared{}, kSecondNs + 400);
  EXPECT_TRUE(watch.follows()) << "until the next reference";
  watch.restart();
  EXPECT_FALSE(watch.follows());
}

TEST(ExposureWatchLimits, WithoutALookWithoutContactNothingBegins) {
  constexpr LightCompared kBrighter{.brighter = 0.1, .lost = 0.1};
  ExposureWatch watch;
  watch.look({.from = LightSeen::From::quiet, .change = 0}, kBrighter, 0);
  watch.look(kNotSeen, kBrighter, kSecondNs);
  EXPECT_FALSE(watch.follows());
  watch.look({.from = LightSeen::From::all, .change = 0}, std::nullopt, 2 * kSecondNs);
  watch.forget();
  watch.look(kNotSeen, kBrighter, 3 * kSecondNs);
  watch.look(kNotSeen, kBrighter, 4 * kSecondNs);
  EXPECT_FALSE(watch.follows());
}

/// The watch after a reference and a second of quiet, at 60 frames a second.
class ExposureWatchTest : public ::testing::Test {
 protected:
  ExposureWatchTest() {
    loop_.begin(toy_calibration());
    EXPECT_TRUE(loop_.until_fresh());
    loop_.step(60);
  }
  /// The left quarter loses `share` of its light, a twelfth of it with each frame.
  void cover(double share) {
    for (int i = 1; i <= 12; ++i) {
      loop_.camera.scene.covered = share * i / 12;
      loop_.step(1);
    }
  }
  /// The light changes to `light` within a quarter of a second, like an exposure.
  void expose(double light) {
    for (int i = 0; i < 60; ++i) {
      loop_.camera.scene.light += 0.15 * (light - loop_.camera.scene.light);
      loop_.step(1);
    }
  }
  [[nodiscard]] bool reported() const { return loop_.health().has(Health::exposure_unlocked); }

  SteppedLoop loop_;
};

TEST_F(ExposureWatchTest, ReportsAnExposureThatKeepsTheMeanAsAnEdgeIsCovered) {
  cover(0.4);  // a tenth of the whole
  expose(1.1);
  EXPECT_FALSE(reported()) << "not before it has lasted a second";
  loop_.step(60);
  EXPECT_TRUE(reported());
  cover(0);
  expose(1);
  loop_.step(150);
  EXPECT_TRUE(reported()) << "the camera has not become another";
  ASSERT_TRUE(loop_.submit(Rezero{}));
  loop_.step(60);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, ACoveredEdgeAloneIsNot) {
  cover(0.4);
  loop_.step(120);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, LightThatWasBrighterBeforeIsNot) {
  expose(1.1);
  loop_.step(60);
  cover(0.4);
  loop_.step(120);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, LightThatBrightensLongAfterIsNot) {
  cover(0.4);
  loop_.step(320);
  expose(1.1);
  loop_.step(120);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, LightThatDimsOrBrightensBySomethingElseIsNot) {
  cover(0.4);
  expose(0.95);
  loop_.step(120);
  EXPECT_FALSE(reported());
  cover(0);
  expose(1);
  loop_.step(60);
  cover(0.12);  // 3 % of the whole
  expose(1.15);
  loop_.step(120);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, ACameraOpenedAnewWithAnotherExposureIsNot) {
  loop_.camera.status = hal::GrabStatus::unplugged;
  loop_.step(10);
  loop_.camera.status = hal::GrabStatus::ok;
  loop_.camera.scene.covered = 0.4;
  loop_.camera.scene.light = 1.1;
  loop_.step(150);
  EXPECT_FALSE(reported());
}

TEST_F(ExposureWatchTest, PressesAreNot) {
  for (const double mm : {0.2, 0.5, 1.0, 1.5, 2.0}) {
    loop_.camera.scene.press_mm = mm;
    loop_.step(120);
    loop_.camera.scene.press_mm = 0;
    loop_.step(30);
  }
  EXPECT_FALSE(reported());
}

}  // namespace
}  // namespace dtact::pipeline
