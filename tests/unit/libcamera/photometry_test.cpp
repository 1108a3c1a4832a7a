#include "hal/libcamera/photometry.hpp"

#include <gtest/gtest.h>
#include <libcamera/control_ids.h>

#include <algorithm>
#include <stdexcept>

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

/// A double of a Raspberry Pi's sensor and its IPA, after src/ipa/rpi/common/ipa_base.cpp. It lists
/// no default exposure or gain (ipaControls). It clamps durations to the mode's
/// (applyFrameDurations()) and exposures to the frame's (applyAGC()), both silently. The metadata
/// hold the values that were used (reportMetadata()).
struct PiSensor {
  std::int64_t shortest_us = 8333;  ///< Frame of the mode.
  std::int64_t line_us = 15;

  [[nodiscard]] lc::ControlInfoMap offered() const {
    return {{{&lc::controls::AeEnable, lc::ControlInfo(false, true)},
             {&lc::controls::ExposureTime, lc::ControlInfo(60, 66666)},
             {&lc::controls::AnalogueGain, lc::ControlInfo(1.0F, 16.0F)},
             {&lc::controls::FrameDurationLimits,
              lc::ControlInfo(shortest_us, std::int64_t{1'000'000})}},
            lc::controls::controls};
  }

  [[nodiscard]] Readings run(const lc::ControlList& asked) const {
    const auto limits = *asked.get(lc::controls::FrameDurationLimits);
    const std::int64_t frame = std::max<std::int64_t>(limits[1], shortest_us);
    const std::int64_t most = frame - 22 * line_us;  // cam_helper_imx477.cpp
    const std::int64_t exposure =
        std::min<std::int64_t>(*asked.get(lc::controls::ExposureTime), most) / line_us * line_us;
    lc::ControlList metadata(lc::controls::controls);
    metadata.set(lc::controls::ExposureTime, static_cast<std::int32_t>(exposure));
    metadata.set(lc::controls::AnalogueGain, *asked.get(lc::controls::AnalogueGain));
    metadata.set(lc::controls::FrameDuration, frame);
    Readings readings;
    PhotometricLock::read(metadata, readings);
    return readings;
  }
};

LibcameraConfig exposure(double us) {
  LibcameraConfig config;
  config.exposure_us = us;
  return config;
}

CameraControl control(const std::vector<CameraControl>& controls, const std::string& name) {
  const auto it = std::ranges::find(controls, name, &CameraControl::name);
  if (it == controls.end()) throw std::runtime_error("no control " + name);
  return *it;
}

TEST(LibcameraPhotometry, RefusesAnExposureLongerThanAFrame) {
  EXPECT_NO_THROW(PhotometricLock(exposure(16000), 60));
  try {
    const PhotometricLock lock(exposure(20000), 60);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(),
                 "camera.libcamera: an exposure of 20000 us is longer than a frame at camera.fps = "
                 "60 (16667 us): lower exposure_us, exposure_pwm_periods or camera.fps");
  }
}

TEST(LibcameraPhotometry, AsksForADefaultExposureThatFitsTheFrame) {
  const PiSensor sensor;
  const auto at_60 = PhotometricLock({}, 60).requested_controls(sensor.offered());
  EXPECT_EQ(*at_60.list.get(lc::controls::ExposureTime), 15000);
  EXPECT_EQ(*at_60.list.get(lc::controls::AnalogueGain), 1.0F);
  EXPECT_EQ((*at_60.list.get(lc::controls::FrameDurationLimits))[0], 16667);
  EXPECT_EQ((*at_60.list.get(lc::controls::FrameDurationLimits))[1], 16667);
  const auto at_30 = PhotometricLock({}, 30).requested_controls(sensor.offered());
  EXPECT_EQ(*at_30.list.get(lc::controls::ExposureTime), 20000);
}

TEST(LibcameraPhotometry, ConfirmsWhatTheFramesWereTakenWith) {
  const PiSensor sensor;
  auto requested_controls =
      PhotometricLock(exposure(6000), 60).requested_controls(sensor.offered());
  EXPECT_EQ(control(requested_controls.controls, "exposure_time").verdict,
            ControlVerdict::accepted);
  EXPECT_EQ(
      PhotometricLock::compare(sensor.run(requested_controls.list), requested_controls.controls),
      "");
  for (const char* name : {"exposure_time", "analogue_gain", "frame_duration"}) {
    EXPECT_EQ(control(requested_controls.controls, name).verdict, ControlVerdict::confirmed)
        << name;
    EXPECT_EQ(control(requested_controls.controls, name).note, "") << name;
  }
  EXPECT_EQ(control(requested_controls.controls, "frame_duration").value, 16667);
}

TEST(LibcameraPhotometry, TakesTheNearestExposureThatTheSensorHas) {
  const PiSensor sensor;
  auto requested_controls = PhotometricLock(exposure(500), 60).requested_controls(sensor.offered());
  const Readings readings = sensor.run(requested_controls.list);
  EXPECT_EQ(PhotometricLock::compare(readings, requested_controls.controls), "");
  const CameraControl entry = control(requested_controls.controls, "exposure_time");
  EXPECT_EQ(entry.verdict, ControlVerdict::confirmed);
  EXPECT_EQ(entry.value, 495);
  // The value stays, so no control has moved.
  EXPECT_EQ(PhotometricLock::compare(readings, requested_controls.controls), "");
}

TEST(LibcameraPhotometry, SaysWhichRateTheSensorRunsAt) {
  PiSensor sensor;
  sensor.shortest_us = 24000;
  auto requested_controls =
      PhotometricLock(exposure(6000), 60).requested_controls(sensor.offered());
  EXPECT_EQ(
      PhotometricLock::compare(sensor.run(requested_controls.list), requested_controls.controls),
      "");
  const CameraControl entry = control(requested_controls.controls, "frame_duration");
  EXPECT_EQ(entry.verdict, ControlVerdict::refused);
  EXPECT_EQ(entry.value, 24000);
  EXPECT_EQ(entry.note,
            "the sensor runs at 41.7 frames a second, not at 60.0: set camera.fps to that, or "
            "another camera.width and camera.height");
}

TEST(LibcameraPhotometry, SaysWhichExposureAFrameLeavesRoomFor) {
  PiSensor sensor;
  sensor.line_us = 100;
  auto requested_controls =
      PhotometricLock(exposure(16600), 60).requested_controls(sensor.offered());
  EXPECT_EQ(
      PhotometricLock::compare(sensor.run(requested_controls.list), requested_controls.controls),
      "");
  const CameraControl entry = control(requested_controls.controls, "exposure_time");
  EXPECT_EQ(entry.verdict, ControlVerdict::refused);
  EXPECT_EQ(entry.value, 14400);
  EXPECT_EQ(entry.note,
            "16600 us were asked for: the frame leaves no more; lower "
            "camera.libcamera.exposure_us or camera.fps");
}

TEST(LibcameraPhotometry, NamesAControlThatMovesLater) {
  const PiSensor sensor;
  auto requested_controls =
      PhotometricLock(exposure(6000), 60).requested_controls(sensor.offered());
  Readings readings = sensor.run(requested_controls.list);
  (void)PhotometricLock::compare(readings, requested_controls.controls);
  readings[lc::controls::ExposureTime.id()] = 7000;
  EXPECT_EQ(PhotometricLock::compare(readings, requested_controls.controls),
            "exposure_time is 7000 though it was 6000");
  EXPECT_EQ(control(requested_controls.controls, "exposure_time").value, 6000);
}

TEST(LibcameraPhotometry, AsksNothingOfACameraWithoutControls) {
  const auto requested_controls = PhotometricLock(exposure(6000), 60).requested_controls({});
  EXPECT_TRUE(requested_controls.list.empty());
  EXPECT_EQ(control(requested_controls.controls, "exposure_time").note,
            "this camera has no exposure_time");
}

// uvcvideo's pipeline reports no control back.
TEST(LibcameraPhotometry, ConfirmsNothingThatTheFramesDoNotSay) {
  const PiSensor sensor;
  auto requested_controls =
      PhotometricLock(exposure(6000), 60).requested_controls(sensor.offered());
  EXPECT_EQ(PhotometricLock::compare({}, requested_controls.controls), "");
  const CameraControl entry = control(requested_controls.controls, "exposure_time");
  EXPECT_EQ(entry.verdict, ControlVerdict::accepted);
  EXPECT_EQ(entry.note, "set; this camera's frames do not say what came of it");
}

TEST(LibcameraPhotometry, ChangesExposureAndGainWithinWhatAFrameLeaves) {
  const PiSensor sensor;
  const PhotometricLock lock(exposure(6000), 60);
  auto requested_controls = lock.requested_controls(sensor.offered());
  auto& controls = requested_controls.controls;
  (void)PhotometricLock::compare(sensor.run(requested_controls.list), controls);
  CameraSettings settings = lock.settings(sensor.offered(), controls);
  ASSERT_TRUE(settings.exposure_us && settings.gain);
  EXPECT_EQ(settings.exposure_us->value, 6000);
  EXPECT_EQ(settings.exposure_us->minimum, 60);
  EXPECT_NEAR(settings.exposure_us->maximum, 15000, 1);
  EXPECT_EQ(settings.gain->value, 1);
  EXPECT_EQ(settings.gain->maximum, 16);
  lc::ControlList list =
      PhotometricLock::changed_controls({.exposure_us = 4170, .gain = 2.5}, controls);
  EXPECT_EQ(*list.get(lc::controls::ExposureTime), 4170);
  EXPECT_EQ(*list.get(lc::controls::AnalogueGain), 2.5F);
  list.merge(requested_controls.list);
  EXPECT_EQ(PhotometricLock::compare(sensor.run(list), controls), "");
  PhotometricLock::read_back(controls, settings);
  EXPECT_EQ(settings.exposure_us->value, 4170);
  EXPECT_EQ(settings.gain->value, 2.5);
  EXPECT_EQ(control(controls, "exposure_time").verdict, ControlVerdict::confirmed);
  EXPECT_FALSE(lock.settings({}, controls).exposure_us.has_value());
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
