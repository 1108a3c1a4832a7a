#include "daemon/calibration/mismatch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/calibration/sample.hpp"

namespace dtact::calibration {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

AttachedCamera same_camera() {
  return {.identity = "usb-0:1.2 \"left\"\\",
          .pixel_format = "MJPEG",
          .width = 12,
          .height = 9,
          .fps = 60,
          .controls = {{"gain", -3}, {"exposure absolute", 157}, {"sharpness", 1}}};
}

TEST(CameraMismatches, NoneWhenAllAgrees) {
  EXPECT_THAT(camera_mismatches(sample(), same_camera()), IsEmpty());
}

TEST(CameraMismatches, EachIsNamed) {
  AttachedCamera now = same_camera();
  now.identity = "usb-0:1.3";
  now.pixel_format = "YUYV";
  now.width = 13;
  now.fps = 30;
  now.controls = {{"exposure absolute", 158}};
  EXPECT_THAT(
      camera_mismatches(sample(), now),
      ElementsAre(HasSubstr("13x9"), HasSubstr("usb-0:1.3"), HasSubstr("YUYV"), HasSubstr("30"),
                  HasSubstr("exposure absolute is 158 but was 157"), HasSubstr("gain")));
}

TEST(CameraMismatches, FrameRatesMayDifferByAHundredth) {
  const auto found_at = [](double fps) {
    AttachedCamera now = same_camera();
    now.fps = fps;
    return camera_mismatches(sample(), now);
  };
  EXPECT_THAT(found_at(60.53), IsEmpty());
  EXPECT_THAT(found_at(59.35), IsEmpty());
  EXPECT_THAT(found_at(60.55), ElementsAre("the frame rate is 60.55 but was 59.94 at calibration"));
  EXPECT_THAT(found_at(59.33), ElementsAre("the frame rate is 59.33 but was 59.94 at calibration"));
}

TEST(CameraMismatches, WhatWasNotRecordedIsNotCompared) {
  Calibration calibration = sample();
  calibration.origin = {};
  AttachedCamera now = same_camera();
  EXPECT_THAT(camera_mismatches(calibration, now), IsEmpty());
  now.height = 10;
  EXPECT_THAT(camera_mismatches(calibration, now), ElementsAre(HasSubstr("12x10")));
}

TEST(LightMismatches, EachLedIsNamed) {
  const Calibration calibration = sample();
  EXPECT_THAT(light_mismatches(calibration, std::vector<std::uint8_t>{255, 254, 253, 0, 1, 2}),
              IsEmpty());
  EXPECT_THAT(light_mismatches(calibration, std::vector<std::uint8_t>{255, 254, 253, 0, 1, 3}),
              ElementsAre(HasSubstr("LED 1 shows 0 1 3 but showed 0 1 2")));
  EXPECT_THAT(light_mismatches(calibration, std::vector<std::uint8_t>{1, 2, 3}),
              ElementsAre(HasSubstr("1 LEDs but 2")));
}

TEST(LightMismatches, NoneWhenTheLightWasNotRecorded) {
  Calibration calibration = sample();
  calibration.origin.leds.clear();
  EXPECT_THAT(light_mismatches(calibration, std::vector<std::uint8_t>{1, 2, 3}), IsEmpty());
}

}  // namespace
}  // namespace dtact::calibration
