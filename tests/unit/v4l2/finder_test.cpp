#include "hal/v4l2/finder.hpp"

#include <gtest/gtest.h>

#include <cerrno>

#include "hal/v4l2/error_of.hpp"
#include "tests/unit/v4l2/emulated_camera.hpp"

namespace dtact::hal::v4l2 {
namespace {

TEST(DeviceName, RefusesWhatIsNoName) {
  for (const char* text : {"video0", "0", "serial:", "bus:", "usb camera"}) {
    EXPECT_THROW(DeviceName{text}, std::runtime_error) << text;
  }
  try {
    const DeviceName name("video0");
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(),
                 "camera.v4l2.device = \"video0\": allowed are a path below /dev, "
                 "\"serial:NUMBER\", \"bus:NAME\", or nothing for the only camera attached "
                 "(dtactctl cameras lists them)");
  }
}

TEST(DeviceName, FindsACameraByEachOfItsNames) {
  const EmulatedCamera device;
  for (const char* text : {"", "serial:4711", "bus:usb-emulated-1", "/dev/video0"}) {
    const auto opened = DeviceName(text).open();
    EXPECT_TRUE(opened.fd);
    EXPECT_EQ(opened.node, "/dev/video0") << text;
  }
  EXPECT_EQ(DeviceName("").open().identity, "bus:usb-emulated-1");
}

TEST(DeviceName, SaysWhatIsAttachedInstead) {
  const EmulatedCamera device;
  try {
    (void)DeviceName("serial:0815").open();
    FAIL() << "no error";
  } catch (const DeviceError& e) {
    EXPECT_EQ(e.state(), CameraState::unplugged);
    EXPECT_STREQ(e.what(),
                 "no camera serial:0815 is attached: plug it in, or set camera.v4l2.device "
                 "(attached: bus:usb-emulated-1 (serial:4711))");
  }
  try {
    (void)DeviceName("/dev/v4l/by-path/nowhere").open();
    FAIL() << "no error";
  } catch (const DeviceError& e) {
    EXPECT_STREQ(e.what(),
                 "/dev/v4l/by-path/nowhere is not there: plug the camera in, or set "
                 "camera.v4l2.device to one that dtactctl cameras lists");
  }
}

TEST(ListAttached, TellsNamesApartAndLeavesOutWhatCapturesNothing) {
  EmulatedCamera device;
  const auto cameras = list_attached();
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_EQ(cameras[0].serial, "4711");
  EXPECT_EQ(cameras[0].bus, "usb-emulated-1");
  EXPECT_EQ(cameras[0].card, "Emulated camera");
  EXPECT_EQ(cameras[0].by_path, "");
  EXPECT_EQ(cameras[0].stable_name(), "bus:usb-emulated-1");
  device.fail(VIDIOC_QUERYCAP, ENOTTY);
  EXPECT_TRUE(list_attached().empty());
}

TEST(ListAttached, DoesNotTakeTheHubsSerialForTheCameras) {
  const EmulatedCamera device;
  device.forget_serial();
  const auto cameras = list_attached();
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_EQ(cameras[0].serial, "");
}

}  // namespace
}  // namespace dtact::hal::v4l2
