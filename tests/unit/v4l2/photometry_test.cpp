#include "hal/v4l2/photometry.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "hal/v4l2/node.hpp"
#include "tests/unit/v4l2/emulated_camera.hpp"

namespace dtact::hal::v4l2 {
namespace {

std::string error_of(const V4l2Config& config) {
  try {
    const PhotometricLock lock(config);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

constexpr const char* kUsbDevice = "/sys/devices/usb/1-1";

std::vector<CameraControl> applied(const V4l2Config& config, int fd) {
  std::vector<CameraControl> controls;
  for (LockedControl& locked : PhotometricLock(config).apply(fd, kUsbDevice)) {
    controls.push_back(std::move(locked.control));
  }
  return controls;
}

base::UniqueFd open_camera() {
  return base::UniqueFd(::open("/dev/video0", O_RDWR | O_NONBLOCK | O_CLOEXEC));
}

TEST(PhotometricLock, RefusesImpossibleConfigurations) {
  V4l2Config c;
  c.controls["zoom"] = 1;
  EXPECT_EQ(error_of(c).substr(0, 60),
            "camera.v4l2.controls.zoom: not a control of the lock; allowe");
  c = {};
  c.exposure_us = -1;
  EXPECT_EQ(error_of(c), "camera.v4l2.exposure_us must be positive, or 0 for the camera's default");
  c = {};
  c.exposure_pwm_periods = -1;
  EXPECT_NE(error_of(c), "");
  c.exposure_pwm_periods = 3;
  EXPECT_EQ(error_of(c),
            "camera.v4l2.exposure_pwm_periods needs camera.v4l2.pwm_hz, the LEDs' PWM frequency "
            "(about 430 Hz for old WS2812B, 2000 Hz for new ones)");
  c.pwm_hz = 2000;
  EXPECT_EQ(error_of(c), "");
  c.exposure_us = 1000;
  EXPECT_EQ(error_of(c), "camera.v4l2: give exposure_us or exposure_pwm_periods, not both");
  c = {};
  c.exposure_us = 1000;
  c.controls["exposure_time_absolute"] = 10;
  EXPECT_EQ(error_of(c),
            "camera.v4l2: give the exposure by exposure_us, by exposure_pwm_periods or by "
            "controls.exposure_time_absolute, not by several");
}

TEST(PhotometricLock, KnowsEveryControlThatMayBeConfigured) {
  V4l2Config c;
  for (const char* name : kV4l2Controls) c.controls[name] = 1;
  EXPECT_EQ(error_of(c), "");
}

TEST(PhotometricLock, ExposesForWholePwmPeriods) {
  const EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  V4l2Config c;
  c.pwm_hz = 2000;
  c.exposure_pwm_periods = 9;
  auto controls = applied(c, fd.get());
  ASSERT_EQ(controls.size(), 5U);
  EXPECT_EQ(controls[3].name, "exposure_time_absolute");
  EXPECT_EQ(controls[3].value, 45);  // 9 × 500 µs in units of 100 µs
  EXPECT_EQ(controls[3].note, "");
  EXPECT_EQ(controls[3].verdict, ControlVerdict::confirmed);

  c.pwm_hz = 430;
  c.exposure_pwm_periods = 1;
  controls = applied(c, fd.get());
  EXPECT_EQ(controls[3].value, 23);
  EXPECT_EQ(controls[3].verdict, ControlVerdict::confirmed);
  EXPECT_EQ(controls[3].note, "2300 us is the nearest this camera has to 2325.6 us");
}

TEST(PhotometricLock, SaysWhatIsRefused) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const V4l2Config config;

  device.fail(VIDIOC_S_CTRL, EIO);
  auto controls = applied(config, fd.get());
  ASSERT_EQ(controls.size(), 5U);
  EXPECT_EQ(controls[4].verdict, ControlVerdict::refused);
  EXPECT_EQ(controls[4].value, 60);  // the actual value, not the requested one
  EXPECT_EQ(controls[4].note, "the camera refuses gain = 5 (Input/output error)");

  device.fail(VIDIOC_S_CTRL, 0);
  device.fail(VIDIOC_G_CTRL, EIO);
  controls = applied(config, fd.get());
  EXPECT_EQ(controls[4].verdict, ControlVerdict::refused);
  EXPECT_EQ(controls[4].note, "gain cannot be read back (Input/output error)");

  device.fail(VIDIOC_G_CTRL, 0);
  device.fail(VIDIOC_QUERYCTRL, EINVAL);
  EXPECT_TRUE(applied(config, fd.get()).empty());
}

TEST(PhotometricLock, SaysWhatFollowsWhereTheNameDoesNot) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  device.refuse(V4L2_CID_EXPOSURE_AUTO_PRIORITY);
  device.ignore(V4L2_CID_POWER_LINE_FREQUENCY);
  const auto controls = applied({}, fd.get());
  ASSERT_EQ(controls.size(), 5U);
  EXPECT_EQ(controls[1].note,
            "the camera refuses exposure_dynamic_framerate = 0 (Input/output error): in the dark "
            "the camera may halve its frame rate");
  EXPECT_EQ(controls[2].note,
            "power_line_frequency is 2 after it was set to 0: the camera may keep its exposure to "
            "the mains, and the LEDs then show as bands");
}

struct Verdicts {
  const char* title;
  bool copied, ignored, asked_before;
  ControlVerdict verdict;
  std::int64_t value;
};

class EachVerdict : public testing::TestWithParam<Verdicts> {};

// A control's verdict after both passes: the second answer may be the driver's own copy.
TEST_P(EachVerdict, IsWhatTheCameraItselfHasSaid) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const Verdicts& p = GetParam();
  if (p.copied) device.answer_from_a_copy(V4L2_CID_GAIN);
  if (p.ignored) device.ignore(V4L2_CID_GAIN);
  if (p.asked_before) (void)list_controls(fd.get());  // by any program since it was plugged in
  const PhotometricLock lock(V4l2Config{});
  const auto before = lock.apply(fd.get(), kUsbDevice);
  std::uint32_t type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  ASSERT_EQ(call(fd.get(), VIDIOC_STREAMON, type), 0);
  const auto controls = lock.apply_again(fd.get(), before);
  ASSERT_EQ(controls.size(), 5U);
  EXPECT_EQ(controls[4].name, "gain");
  EXPECT_EQ(controls[4].verdict, p.verdict);
  EXPECT_EQ(controls[4].value, p.value);
  EXPECT_EQ(controls[4].note,
            p.verdict == ControlVerdict::refused ? "gain is 60 after it was set to 5" : "");
}

INSTANTIATE_TEST_SUITE_P(
    PhotometricLock, EachVerdict,
    testing::Values(
        Verdicts{"AlwaysAsked", false, false, false, ControlVerdict::confirmed, 5},
        Verdicts{"AlwaysAskedAndIgnored", false, true, false, ControlVerdict::refused, 60},
        Verdicts{"AskedOnce", true, false, false, ControlVerdict::confirmed, 5},
        Verdicts{"AskedOnceAndIgnored", true, true, false, ControlVerdict::refused, 60},
        Verdicts{"AskedBefore", true, false, true, ControlVerdict::accepted, 5},
        Verdicts{"AskedBeforeAndIgnored", true, true, true, ControlVerdict::accepted, 5}),
    [](const auto& row) { return std::string(row.param.title); });

TEST(PhotometricLock, ConfirmsNothingWithoutAUsbDevice) {
  const EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  for (const LockedControl& locked : PhotometricLock(V4l2Config{}).apply(fd.get(), {})) {
    EXPECT_EQ(locked.control.verdict, ControlVerdict::accepted) << locked.control.name;
  }
}

// Refused before the stream and accepted in it: not confirmed.
TEST(PhotometricLock, WhatTheStreamBringsIsAccepted) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const PhotometricLock lock(V4l2Config{});
  device.fail(VIDIOC_S_CTRL, EIO);
  const auto before = lock.apply(fd.get(), kUsbDevice);
  device.fail(VIDIOC_S_CTRL, 0);
  for (const CameraControl& control : lock.apply_again(fd.get(), before)) {
    EXPECT_EQ(control.verdict, ControlVerdict::accepted) << control.name;
    EXPECT_EQ(control.note, "");
  }
}

TEST(PhotometricLock, FallsBackToShutterPriority) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  device.fail(VIDIOC_S_CTRL, EINVAL, 1);  // manual mode
  const auto controls = applied({}, fd.get());
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_SHUTTER_PRIORITY);
  EXPECT_EQ(controls[0].verdict, ControlVerdict::confirmed);
}

TEST(PhotometricLock, FindsAndSetsBackWhatMoved) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const PhotometricLock lock(V4l2Config{});
  auto controls = applied({}, fd.get());
  EXPECT_EQ(lock.check(fd.get(), controls), "");
  device.set_control(V4L2_CID_GAIN, 33);
  EXPECT_EQ(lock.check(fd.get(), controls),
            "gain moved from 5 to 33 by itself: it was set back; another program or the camera's "
            "own automatic is at work");
  EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);
  EXPECT_EQ(lock.check(fd.get(), controls), "");
}

TEST(PhotometricLock, LocksAtTheNearestStep) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  device.set_step(V4L2_CID_EXPOSURE_ABSOLUTE, 10);  // 1, 11, ... 991
  V4l2Config c;
  c.exposure_us = 20'000;
  auto controls = applied(c, fd.get());
  EXPECT_EQ(controls[3].value, 201);
  EXPECT_EQ(controls[3].verdict, ControlVerdict::confirmed);
  EXPECT_EQ(controls[3].note, "");
  c.exposure_us = 700;
  controls = applied(c, fd.get());
  EXPECT_EQ(controls[3].value, 11);
  EXPECT_EQ(controls[3].note, "1100 us is the nearest this camera has to 700.0 us");
}

TEST(PhotometricLock, ChangesToTheNearestStep) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  auto controls = applied({}, fd.get());
  device.set_step(V4L2_CID_EXPOSURE_ABSOLUTE, 10);  // 1, 11, ... 991
  struct Row {
    double asked_us;
    std::int64_t value;
  };
  for (const Row row : {Row{20000, 201}, Row{20700, 211}, Row{100, 1}, Row{100000, 991}}) {
    PhotometricLock::change(fd.get(), {.exposure_us = row.asked_us, .gain = {}}, controls);
    EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), row.value);
    EXPECT_EQ(controls[3].value, row.value);
    EXPECT_EQ(controls[3].verdict, ControlVerdict::accepted);
  }
  EXPECT_THROW(PhotometricLock::change(fd.get(), {.exposure_us = 100100, .gain = {}}, controls),
               std::runtime_error);
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 991);
}

// Else check() would set it back later, as a control that moved by itself.
TEST(PhotometricLock, AFailedChangeLeavesEverythingAsItWas) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const PhotometricLock lock(V4l2Config{});
  auto controls = applied({}, fd.get());
  const auto expect_unchanged = [&] {
    EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 156);
    EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);
    EXPECT_EQ(controls[3].value, 156);
    EXPECT_EQ(controls[3].verdict, ControlVerdict::confirmed);
    EXPECT_EQ(controls[4].value, 5);
    EXPECT_EQ(lock.check(fd.get(), controls), "");
  };
  device.fail(VIDIOC_G_CTRL, EIO, 1);
  EXPECT_THROW(PhotometricLock::change(fd.get(), {.exposure_us = 20000, .gain = 7}, controls),
               std::runtime_error);
  expect_unchanged();
  device.refuse(V4L2_CID_GAIN);
  EXPECT_THROW(PhotometricLock::change(fd.get(), {.exposure_us = 20000, .gain = 7}, controls),
               std::runtime_error);
  expect_unchanged();
}

TEST(ListControls, SaysRangesAndValues) {
  const EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const auto offered = list_controls(fd.get());
  ASSERT_EQ(offered.size(), 5U);
  EXPECT_EQ(offered[4].name, "gain");
  EXPECT_EQ(offered[4].maximum, 100);
  EXPECT_EQ(offered[4].initial, 5);
  EXPECT_EQ(offered[4].value, 60);
}

}  // namespace
}  // namespace dtact::hal::v4l2
