#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>

#include "daemon/pipeline/reference/reference_keeper.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

using fakes::ToyFrame;
using fakes::ToyScene;

/// The keeper before a sensor whose scene the test sets. 8 frames to settle, 16 in an average.
class KeeperTest : public ::testing::Test {
 protected:
  KeeperTest() {
    measure(calibration->model->reference_q8, fakes::kToyWidth, fakes::kToyHeight, grid);
  }
  void calibrate(bool same_light = true) {
    keeper.use_calibration(calibration->model->reference_q8, grid, region, same_light);
  }

  /// Steps until an event, at most `most` frames; the last result stays in `last`.
  bool run(int most) {
    for (int i = 0; i < most; ++i) {
      last = keeper.step(ToyFrame(scene, sequence++).view());
      if (last.reference_changed || last.answer) return true;
    }
    return false;
  }
  /// Largest error of the reference in use under the present light, grey levels.
  [[nodiscard]] double worst_error() const {
    ToyScene no_contact = scene;
    no_contact.press_mm = 0;
    double worst = 0;
    for (int y = 10; y < fakes::kToyHeight - 10; ++y) {
      for (int x = 10; x < fakes::kToyWidth - 10; ++x) {
        const std::size_t i =
            static_cast<std::size_t>(y) * fakes::kToyWidth + static_cast<std::size_t>(x);
        worst = std::max(
            worst, std::abs(keeper.reference()[i] / 256.0 - fakes::toy_grey(no_contact, x, y)));
      }
    }
    return worst;
  }

  static ReferenceRules rules() {
    return {.frames = 16, .settle_frames = 8, .settle_grey = 0.25, .timeout_frames = 100};
  }
  std::shared_ptr<calibration::Calibration> calibration = fakes::toy_calibration();
  LumaGrid grid;
  CellRegion region{.x0 = 2, .y0 = 2, .x1 = 38, .y1 = 28};
  ReferenceKeeper keeper{fakes::kToyWidth, fakes::kToyHeight, rules()};
  ToyScene scene;
  std::uint64_t sequence = 0;
  ReferenceStep last;
};

TEST_F(KeeperTest, TakesAReferenceOnceTheMeanHasSettled) {
  calibrate();
  EXPECT_TRUE(keeper.starting());
  EXPECT_FALSE(keeper.ready());
  EXPECT_FALSE(run(23));  // 8 to settle, 15 of 16
  EXPECT_EQ(keeper.state(), State::referencing);
  EXPECT_TRUE(run(1));
  EXPECT_TRUE(last.reference_changed);
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_EQ(keeper.state(), State::serving);
  EXPECT_TRUE(keeper.storable());
  // Rounding scatters by at most half a level; over 16 frames 0.125, five of which are 0.63.
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, WaitsWhileTheLightWarmsUp) {
  calibrate();
  for (int i = 0; i < 40; ++i) {
    scene.light = 0.5 + 0.0125 * i;
    EXPECT_FALSE(run(1));
    EXPECT_EQ(keeper.state(), State::settling);
  }
  EXPECT_TRUE(run(30));
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, InContactAtStartUsesTheLastGoodOne) {
  const ToyScene yesterday{.light = 0.97};  // drift since
  keeper.restore(fakes::toy_reference_q8(yesterday), true, true);
  calibrate();
  scene.press_mm = 1;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::restored);
  EXPECT_FALSE(keeper.storable());
  EXPECT_LT(worst_error(), 1.0);
  EXPECT_FALSE(run(100));  // nothing changes during contact
  scene.press_mm = 0;
  ASSERT_TRUE(run(60));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

TEST_F(KeeperTest, AfterAStartTheLastGoodOneServesUntilANewOneIsTaken) {
  keeper.restore(fakes::toy_reference_q8({.light = 0.97}), true, true);
  calibrate();
  EXPECT_FALSE(run(7));
  ASSERT_TRUE(run(1)) << "the picture has settled";
  EXPECT_EQ(keeper.quality(), ReferenceQuality::restored);
  EXPECT_EQ(keeper.state(), State::serving);
  EXPECT_LT(worst_error(), 1.0);
  EXPECT_FALSE(run(16 + 15)) << "two looks, and all but one frame of an average";
  ASSERT_TRUE(run(1));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, AfterAStartUnderAnotherLightANewReferenceIsAwaited) {
  keeper.restore(fakes::toy_reference_q8({.light = 0.6}), false, true);
  calibrate();
  EXPECT_FALSE(run(23)) << "8 to settle, 15 of 16";
  ASSERT_TRUE(run(1));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

// Exposure, ambient light or the camera itself may be others under the same light of the ring.
TEST_F(KeeperTest, AfterAStartAnImageThatDoesNotAgreeIsNotComparedWithTheLastGoodOne) {
  keeper.restore(fakes::toy_reference_q8({.tilt = 0.8}), true, true);
  calibrate();
  EXPECT_FALSE(run(23)) << "8 to settle, 15 of 16";
  ASSERT_TRUE(run(1));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, InContactAtStartWithoutOneScalesTheCalibrations) {
  calibrate();
  scene.press_mm = 1;
  scene.light = 0.8;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
  EXPECT_LT(worst_error(), 1.0);
}

// 0.016 of the field's light: other LEDs leave as much of their shape; a contact of 0.1 mm has it.
TEST_F(KeeperTest, UnderAnotherLightThanTheCalibrationsALittleShapeIsNoContact) {
  scene.press_mm = 0.1;
  calibrate(false);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

TEST_F(KeeperTest, UnderTheCalibrationsLightTheSameIsAContact) {
  scene.press_mm = 0.1;
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
}

TEST_F(KeeperTest, ALastGoodOneFromAnotherLightIsStale) {
  keeper.restore(fakes::toy_reference_q8({.light = 0.6}), false, true);
  calibrate();
  scene.press_mm = 1;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
  EXPECT_LT(worst_error(), 1.0);
}

TEST_F(KeeperTest, AMovingPressAtStartIsContactInTheEnd) {
  calibrate();
  for (int i = 0; i < 300 && !keeper.ready(); ++i) {
    scene.press_mm = 0.5 + 0.1 * (i % 5);
    (void)run(1);
  }
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
}

TEST_F(KeeperTest, RezeroUnderContactIsRefusedAtOnce) {
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.rezero(false, true), Outcome::refused_contact);
}

TEST_F(KeeperTest, RezeroSeesAContactThatTheDepthMissed) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.press_mm = 0.09;  // 1.8 % of the light; the limit is 1.25 %
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::refused_contact);
  EXPECT_FALSE(last.reference_changed);
  scene.press_mm = 0.05;
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::done);
}

TEST_F(KeeperTest, WhatMovesSlowlyIsNotAveraged) {
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  for (int i = 0; i < 50; ++i) {
    scene.light -= 0.002;  // 0.3 grey levels a frame: less than what counts as movement
    ASSERT_FALSE(run(1)) << i;
  }
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::done);
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, NoContactTwiceInARowEndsAFallback) {
  calibrate();
  scene.press_mm = 1;
  ASSERT_TRUE(run(40));
  ASSERT_EQ(keeper.quality(), ReferenceQuality::stale);
  // The keeper checks every eighth frame.
  ASSERT_FALSE(run(8));
  scene.press_mm = 0;
  ASSERT_FALSE(run(8));
  scene.press_mm = 1;
  ASSERT_FALSE(run(8));
  scene.press_mm = 0;
  EXPECT_FALSE(run(16 + 15)) << "two looks, and all but one frame of an average";
  EXPECT_TRUE(run(1));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

TEST_F(KeeperTest, ANewCalibrationForgetsTheLastGoodOneThatOnlyStoodIn) {
  keeper.restore(fakes::toy_reference_q8({.tilt = 0.4}), true, true);
  calibrate();
  scene.press_mm = 1;
  ASSERT_TRUE(run(40));
  ASSERT_EQ(keeper.quality(), ReferenceQuality::restored);
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
  EXPECT_LT(worst_error(), 1.0) << "the calibration's own, scaled";
}

TEST_F(KeeperTest, ForcedRezeroTakesTheImageInContactButDoesNotKeepIt) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.press_mm = 1;
  EXPECT_EQ(keeper.rezero(true, true), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::done);
  EXPECT_TRUE(last.reference_changed);
  EXPECT_FALSE(keeper.storable());
  // After lifting, the surface is brighter than its reference; re-zeroing then is not contact.
  scene.press_mm = 0;
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::done);
  EXPECT_TRUE(keeper.storable());
}

// The object rests on while the camera is plugged in again: the image is like the forced one.
TEST_F(KeeperTest, AReferenceThatFollowsAForcedOneInContactIsNotKeptEither) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.press_mm = 1;
  EXPECT_EQ(keeper.rezero(true, true), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.rezero(true, true), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_FALSE(keeper.storable()) << "forced twice";
  keeper.begin();
  ASSERT_TRUE(run(60));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_FALSE(keeper.storable());
  scene.press_mm = 0;
  keeper.light_changed(false, true);
  ASSERT_TRUE(run(60));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_TRUE(keeper.storable()) << "the calibration sees no contact";
}

TEST_F(KeeperTest, RezeroFollowsDrift) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.light = 0.985;  // −2 grey levels
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  ASSERT_TRUE(run(40));
  EXPECT_EQ(last.answer, Outcome::done);
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, RezeroOfAMovingImageIsRefused) {
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  for (int i = 0; i < 200 && !last.answer; ++i) {
    scene.light = i % 2 == 0 ? 1 : 0.95;
    (void)run(1);
  }
  EXPECT_EQ(last.answer, Outcome::refused_unsteady);
}

TEST_F(KeeperTest, ALightChangeWithoutContactTakesANewOne) {
  calibrate();
  ASSERT_TRUE(run(40));
  keeper.light_changed(false, false);
  EXPECT_FALSE(keeper.ready());
  EXPECT_FALSE(keeper.starting());
  scene.light = 0.5;
  scene.tilt = 0.2;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
  EXPECT_LT(worst_error(), 0.7);
}

TEST_F(KeeperTest, ALightChangeUnderContactScalesAndWaits) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.press_mm = 1;
  keeper.light_changed(true, true);
  scene.light = 0.5;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
  EXPECT_LT(worst_error(), 0.8);
  scene.press_mm = 0;
  ASSERT_TRUE(run(60));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

TEST_F(KeeperTest, AfterATouchALighterOneIsNotTakenForNone) {
  calibrate();
  ASSERT_TRUE(run(40));
  keeper.light_changed(false, true);
  scene.light = 0.5;
  scene.press_mm = 1;
  ASSERT_TRUE(run(60));
  ASSERT_EQ(keeper.quality(), ReferenceQuality::stale);
  scene.press_mm = 0.15;
  EXPECT_FALSE(run(200));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
}

TEST_F(KeeperTest, ALongPressIsNeverAbsorbed) {
  calibrate();
  ASSERT_TRUE(run(40));
  scene.press_mm = 0.5;
  EXPECT_FALSE(run(500));
}

TEST_F(KeeperTest, InTheDarkThereIsNoReference) {
  calibrate();
  ASSERT_TRUE(run(40));
  keeper.light_changed(false, true);
  scene.light = 0;
  EXPECT_FALSE(run(150));
  EXPECT_EQ(keeper.state(), State::settling);
  EXPECT_EQ(keeper.rezero(true, false), std::nullopt);
  ASSERT_TRUE(run(2));
  EXPECT_EQ(last.answer, Outcome::refused_dark);
  scene.light = 1;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::fresh);
}

TEST_F(KeeperTest, ACameraThatCameBackIsLookedAtAnew) {
  calibrate();
  ASSERT_TRUE(run(40));
  keeper.begin();
  EXPECT_TRUE(keeper.starting());
  EXPECT_FALSE(keeper.ready());
  scene.press_mm = 1;
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::restored);
}

TEST_F(KeeperTest, ANewCalibrationKeepsAFreshReference) {
  calibrate();
  ASSERT_TRUE(run(40));
  calibrate();
  EXPECT_TRUE(keeper.ready());
}

// The first timeout_frames frames are waited for; what is not still then counts as in contact.
TEST_F(KeeperTest, ARezeroOfAMovingImageIsRefusedOnceTheTimeIsOver) {
  calibrate();
  ASSERT_TRUE(run(40));
  EXPECT_EQ(keeper.rezero(false, false), std::nullopt);
  for (int i = 0; i < 100; ++i) {
    scene.light = i % 2 == 0 ? 1 : 0.95;
    ASSERT_FALSE(run(1)) << i;
  }
  ASSERT_TRUE(run(1));
  EXPECT_EQ(last.answer, Outcome::refused_unsteady);
  EXPECT_FALSE(last.reference_changed);
}

TEST_F(KeeperTest, AMovingImageAtStartIsWaitedForTwice) {
  calibrate();
  const auto flicker = [this](int frames) {
    for (int i = 0; i < frames; ++i) {
      scene.light = i % 2 == 0 ? 0.95 : 1;
      if (run(1)) return true;
    }
    return false;
  };
  EXPECT_FALSE(flicker(100));
  EXPECT_EQ(keeper.state(), State::settling);
  EXPECT_FALSE(flicker(1));
  EXPECT_EQ(keeper.state(), State::referencing);
  EXPECT_FALSE(flicker(100));
  EXPECT_EQ(keeper.state(), State::referencing);
  EXPECT_TRUE(flicker(1));
  EXPECT_EQ(keeper.quality(), ReferenceQuality::stale);
}

TEST_F(KeeperTest, FramesHave80By60PixelsAtLeast) {
  EXPECT_NO_THROW(ReferenceKeeper(80, 60, rules()));
  EXPECT_THROW(ReferenceKeeper(80, 59, rules()), std::invalid_argument);
  EXPECT_THROW(ReferenceKeeper(79, 60, rules()), std::invalid_argument);
}

TEST_F(KeeperTest, RefusesWhatCannotWork) {
  EXPECT_THROW(ReferenceKeeper(79, 60, rules()), std::invalid_argument);
  EXPECT_THROW(keeper.restore(std::vector<std::uint16_t>(5), true, true), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::pipeline
