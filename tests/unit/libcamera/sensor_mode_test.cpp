#include "hal/libcamera/sensor_mode.hpp"

#include <gtest/gtest.h>
#include <libcamera/control_ids.h>

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

CameraConfig asked(int width, int height, double fps) {
  CameraConfig c;
  c.width = width;
  c.height = height;
  c.fps = fps;
  return c;
}

/// The Raspberry Pi HQ camera's modes, as rpicam-hello --list-cameras prints them.
const std::vector<SensorMode> kImx477{{1332, 990, 10, 120.05},
                                      {2028, 1080, 12, 50.03},
                                      {2028, 1520, 12, 40.01},
                                      {4056, 3040, 12, 10.0}};

TEST(SensorMode, TheLargestThatKeepsTheRate) {
  const auto mode = choose_sensor_mode(kImx477, asked(800, 600, 60));
  ASSERT_TRUE(mode);
  EXPECT_EQ(mode->width, 1332U);
  EXPECT_EQ(mode->bit_depth, 10U);
  EXPECT_EQ(choose_sensor_mode(kImx477, asked(800, 600, 40))->height, 1520U);
}

TEST(SensorMode, NoneThatWouldHaveToBeEnlarged) {
  EXPECT_FALSE(choose_sensor_mode(kImx477, asked(1920, 1080, 60)));
  EXPECT_FALSE(choose_sensor_mode({}, asked(800, 600, 60)));
}

TEST(SensorMode, MoreBitsOfTheSameSize) {
  const auto mode =
      choose_sensor_mode({{1640, 1232, 8, 83}, {1640, 1232, 10, 83}}, asked(800, 600, 60));
  ASSERT_TRUE(mode);
  EXPECT_EQ(mode->bit_depth, 10U);
}

TEST(SensorMode, ReadsTheRateFromTheShortestFrame) {
  EXPECT_EQ(fastest_rate(lc::ControlInfoMap()), 0);
  const lc::ControlInfoMap controls({{&lc::controls::FrameDurationLimits,
                                      lc::ControlInfo(std::int64_t{25000}, std::int64_t{120000})}},
                                    lc::controls::controls);
  EXPECT_EQ(fastest_rate(controls), 40);
  EXPECT_TRUE(keeps_rate(0, 60));
  EXPECT_TRUE(keeps_rate(59.6, 60));
  EXPECT_FALSE(keeps_rate(59.4, 60));
}

TEST(SensorMode, ReadsTheBitsOfAFormatsName) {
  EXPECT_EQ(bit_depth("R8"), 8U);
  EXPECT_EQ(bit_depth("R10_CSI2P"), 10U);
  EXPECT_EQ(bit_depth("SRGGB10_CSI2P"), 10U);
  EXPECT_EQ(bit_depth("SBGGR12"), 12U);
  EXPECT_EQ(bit_depth("RGB888"), 0U);
  EXPECT_EQ(bit_depth("NV12"), 0U);
}

TEST(SensorMode, ReportsWhatWouldDo) {
  EXPECT_EQ(too_slow("imx219", 41.85, {{640, 480, 10, 206.65}}, asked(800, 600, 60)),
            "imx219 gives at most 41.9 frames a second at 800x600, not 60: lower camera.fps, or "
            "camera.width and camera.height; its sensor has 640x480 with 10 bits at up to 206.7");
}

}  // namespace
}  // namespace dtact::hal::libcamera_backend
