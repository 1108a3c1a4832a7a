#include "hal/libcamera/control_exchange.hpp"

#include <gtest/gtest.h>
#include <libcamera/control_ids.h>

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

/// A camera whose frames have a request's exposure, in lines of 15 us, seven frames later.
class DelayedCamera {
 public:
  /// Takes frames and hands each back at once.
  void pass(int frames, ControlExchange& exchange) {
    for (; frames > 0; --frames) {
      lc::ControlList metadata(lc::controls::controls);
      metadata.set(lc::controls::ExposureTime, under_way_.front());
      under_way_.pop_front();
      exchange.read(metadata);
      lc::ControlList request(lc::controls::controls);
      exchange.add_changes(request);
      if (request.contains(lc::controls::ExposureTime.id())) {
        asked_ = *request.get(lc::controls::ExposureTime) / 15 * 15;
      }
      under_way_.push_back(asked_);
    }
  }

 private:
  std::int32_t asked_ = 6000;
  std::deque<std::int32_t> under_way_ = std::deque<std::int32_t>(7, 6000);
};

std::vector<CameraControl> exposure_of(std::int64_t us) {
  return {{"exposure_time", us, ControlVerdict::accepted}};
}

// During an opening no frames are taken by themselves, and a slow camera gives few in any time.
TEST(ControlExchange, DoesNotJudgeAChangeByTheFramesBefore) {
  ControlExchange exchange;
  DelayedCamera camera;
  camera.pass(kSettlingFrames, exchange);
  auto controls = exposure_of(6000);
  EXPECT_EQ(exchange.compare(controls), "");
  ASSERT_EQ(controls[0].verdict, ControlVerdict::confirmed);

  exchange.change({.exposure_us = 500, .gain = {}}, controls);
  for (int taken = 0; taken < kSettlingFrames; ++taken) {
    EXPECT_FALSE(exchange.settled());
    EXPECT_EQ(exchange.compare(controls), "");
    ASSERT_EQ(controls[0].verdict, ControlVerdict::accepted) << taken;
    ASSERT_EQ(controls[0].value, 500) << taken;
    camera.pass(1, exchange);
  }
  camera.pass(1, exchange);  // the first was read before the change was taken
  EXPECT_TRUE(exchange.settled());
  EXPECT_EQ(exchange.compare(controls), "");
  EXPECT_EQ(controls[0].verdict, ControlVerdict::confirmed);
  EXPECT_EQ(controls[0].value, 495);
}

TEST(ControlExchange, JudgesAStartAfterItsFirstFramesOnly) {
  ControlExchange exchange;
  DelayedCamera camera;
  auto controls = exposure_of(6000);
  EXPECT_FALSE(exchange.has_readings());
  camera.pass(kSettlingFrames - 1, exchange);
  EXPECT_TRUE(exchange.has_readings());
  EXPECT_EQ(exchange.compare(controls), "");
  EXPECT_EQ(controls[0].verdict, ControlVerdict::accepted);
  camera.pass(1, exchange);
  EXPECT_EQ(exchange.compare(controls), "");
  EXPECT_EQ(controls[0].verdict, ControlVerdict::confirmed);
}

TEST(ControlExchange, KeepsAChangeThatNoRequestHasTakenYet) {
  ControlExchange exchange;
  std::vector<CameraControl> controls;
  exchange.change({.exposure_us = 500, .gain = 1}, controls);
  exchange.change({.exposure_us = {}, .gain = 2}, controls);
  lc::ControlList request(lc::controls::controls);
  exchange.add_changes(request);
  EXPECT_EQ(request.get(lc::controls::ExposureTime), 500);
  EXPECT_EQ(request.get(lc::controls::AnalogueGain), 2.0F);
  lc::ControlList next(lc::controls::controls);
  exchange.add_changes(next);
  EXPECT_TRUE(next.empty());
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
