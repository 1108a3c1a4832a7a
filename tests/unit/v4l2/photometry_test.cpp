#include "hal/v4l2/photometry.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <stdexcept>

#include "hal/base/unique_fd.hpp"
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
  auto controls = PhotometricLock(c).apply(fd.get());
  ASSERT_EQ(controls.size(), 3U);
  EXPECT_EQ(controls[1].name, "exposure_time_absolute");
  EXPECT_EQ(controls[1].value, 45);  // 9 × 500 µs in units of 100 µs
  EXPECT_EQ(controls[1].note, "");
  EXPECT_TRUE(controls[1].locked);

  c.pwm_hz = 430;
  c.exposure_pwm_periods = 1;
  controls = PhotometricLock(c).apply(fd.get());
  EXPECT_EQ(controls[1].value, 23);
  EXPECT_TRUE(controls[1].locked);
  EXPECT_EQ(controls[1].note, "2300 us is the nearest this camera has to 2325.6 us");
}

TEST(PhotometricLock, SaysWhatIsRefused) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const PhotometricLock lock(V4l2Config{});

  device.fail(VIDIOC_S_CTRL, EIO);
  auto controls = lock.apply(fd.get());
  ASSERT_EQ(controls.size(), 3U);
  EXPECT_FALSE(controls[2].locked);
  EXPECT_EQ(controls[2].value, 60);  // as it is, not as it should be
  EXPECT_EQ(controls[2].note, "the camera refuses gain = 5 (Input/output error)");

  device.fail(VIDIOC_S_CTRL, 0);
  device.fail(VIDIOC_G_CTRL, EIO);
  controls = lock.apply(fd.get());
  EXPECT_EQ(controls[2].note, "gain cannot be read back (Input/output error)");

  device.fail(VIDIOC_G_CTRL, 0);
  device.fail(VIDIOC_QUERYCTRL, EINVAL);
  EXPECT_TRUE(lock.apply(fd.get()).empty());
}

TEST(PhotometricLock, FallsBackToShutterPriority) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  device.fail(VIDIOC_S_CTRL, EINVAL, 1);  // manual mode
  const auto controls = PhotometricLock(V4l2Config{}).apply(fd.get());
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_SHUTTER_PRIORITY);
  EXPECT_TRUE(controls[0].locked);
}

TEST(PhotometricLock, FindsAndSetsBackWhatMoved) {
  EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const PhotometricLock lock(V4l2Config{});
  auto controls = lock.apply(fd.get());
  EXPECT_EQ(lock.check(fd.get(), controls), "");
  device.set_control(V4L2_CID_GAIN, 33);
  EXPECT_EQ(lock.check(fd.get(), controls),
            "gain moved from 5 to 33 by itself: it was set back; another program or the camera's "
            "own automatic is at work");
  EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);
  EXPECT_EQ(lock.check(fd.get(), controls), "");
}

TEST(ListControls, SaysRangesAndValues) {
  const EmulatedCamera device;
  const base::UniqueFd fd = open_camera();
  const auto offered = list_controls(fd.get());
  ASSERT_EQ(offered.size(), 3U);
  EXPECT_EQ(offered[2].name, "gain");
  EXPECT_EQ(offered[2].maximum, 100);
  EXPECT_EQ(offered[2].initial, 5);
  EXPECT_EQ(offered[2].value, 60);
}

}  // namespace
}  // namespace dtact::hal::v4l2
