#include <gtest/gtest.h>

#include <cmath>

#include "daemon/pipeline/reference/image_watch.hpp"
#include "tests/fakes/stepped_loop.hpp"

namespace dtact::pipeline {
namespace {

using fakes::SteppedLoop;
using fakes::toy_calibration;

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
