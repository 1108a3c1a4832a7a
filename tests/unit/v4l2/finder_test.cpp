#include "hal/v4l2/finder.hpp"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <string>
#include <vector>

#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/node.hpp"
#include "tests/unit/v4l2/emulated_camera.hpp"
#include "tests/unit/v4l2/emulated_nodes.hpp"

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
    const auto opened = DeviceName(text).open(32, 16);
    EXPECT_TRUE(opened.fd);
    EXPECT_EQ(opened.node, "/dev/video0") << text;
  }
  EXPECT_EQ(DeviceName("").open(32, 16).identity, "bus:usb-emulated-1");
}

TEST(DeviceName, SaysWhatIsAttachedInstead) {
  const EmulatedCamera device;
  try {
    (void)DeviceName("serial:0815").open(32, 16);
    FAIL() << "no error";
  } catch (const DeviceError& e) {
    EXPECT_EQ(e.state(), CameraState::unplugged);
    EXPECT_STREQ(e.what(),
                 "no camera serial:0815 is attached: plug it in, or set camera.v4l2.device "
                 "(attached: bus:usb-emulated-1 (serial:4711))");
  }
  try {
    (void)DeviceName("/dev/v4l/by-path/nowhere").open(32, 16);
    FAIL() << "no error";
  } catch (const DeviceError& e) {
    EXPECT_STREQ(e.what(),
                 "/dev/v4l/by-path/nowhere is not there: plug the camera in, or set "
                 "camera.v4l2.device to one that dtactctl cameras lists");
  }
}

TEST(ListAttached, ReportsNamesApartAndLeavesOutWhatCapturesNothing) {
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

constexpr std::uint32_t kCapture = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;

/// uvcvideo's two nodes.
const EmulatedNode kUsb{.number = 0,
                        .usb = true,
                        .caps = kCapture,
                        .name = "uvcvideo",
                        .bus = "usb-1",
                        .has_input = true,
                        .fourcc = V4L2_PIX_FMT_MJPEG,
                        .width = 800,
                        .height = 600};
const EmulatedNode kUsbMetadata{.number = 1,
                                .usb = true,
                                .caps = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING,
                                .name = "uvcvideo",
                                .bus = "usb-1"};

/// A node of bcm2835-isp; a Pi 4 has four of them (bcm2835-v4l2-isp.c in raspberrypi/linux;
/// V4L2's core adds V4L2_CAP_EXT_PIX_FORMAT to the capabilities, which are then 0x04200001).
EmulatedNode scaler(int number) {
  return {.number = number,
          .caps = kCapture | V4L2_CAP_EXT_PIX_FORMAT,
          .name = "bcm2835-isp",
          .bus = "platform:bcm2835-isp",
          .fourcc = V4L2_PIX_FMT_YUYV};
}
const EmulatedNode kCodec{.number = 10,
                          .caps = V4L2_CAP_VIDEO_M2M_MPLANE | V4L2_CAP_STREAMING,
                          .name = "bcm2835-codec-decode",
                          .bus = "platform:bcm2835-codec"};
/// A camera at a port of its own, like bcm2835-unicam without a media controller.
const EmulatedNode kPort{.number = 2,
                         .caps = kCapture,
                         .name = "unicam",
                         .bus = "platform:fe801000.csi",
                         .has_input = true,
                         .fourcc = V4L2_PIX_FMT_GREY,
                         .width = 640,
                         .height = 480};
/// A Pi 5's camera interface: the media controller decides which image comes out.
const EmulatedNode kPipeline{.number = 3,
                             .caps = kCapture | V4L2_CAP_IO_MC,
                             .name = "rp1-cfe",
                             .bus = "platform:1f00110000.csi",
                             .has_input = true,
                             .fourcc = V4L2_PIX_FMT_YUYV};

std::string opened(const std::string& name, int width, int height) {
  try {
    return DeviceName(name).open(width, height).node;
  } catch (const DeviceError& e) {
    return e.what();
  }
}

TEST(TheOnlyCamera, IsTheOneOnUsb) {
  const EmulatedNodes nodes({kUsb, kUsbMetadata, kPort, kPipeline, kCodec, scaler(14), scaler(15),
                             scaler(21), scaler(22)});
  EXPECT_EQ(opened("", 800, 600), "/dev/video0");
  EXPECT_EQ(opened("", 640, 480), "/dev/video0");  // its error then lists the sizes
  EXPECT_EQ(list_attached().size(), 2U);           // both can be named
  EXPECT_EQ(opened("bus:platform:fe801000.csi", 800, 600), "/dev/video2");
}

TEST(TheOnlyCamera, IsWhateverDeliversTheSizeWhereNoneIsOnUsb) {
  EmulatedNode other = kPort;
  other.number = 4;
  other.fourcc = V4L2_PIX_FMT_SBGGR10;  // cannot be read
  const EmulatedNodes nodes({kPort, kPipeline, kCodec, scaler(14), scaler(15), other});
  EXPECT_EQ(opened("", 640, 480), "/dev/video2");
  EXPECT_EQ(opened("", 800, 600),
            "no camera is attached: plug it in (dtactctl cameras says why other video nodes are "
            "not taken)");
}

TEST(TheOnlyCamera, IsNoneOfAPiSOwnNodes) {
  const EmulatedNodes nodes({kCodec, scaler(14), scaler(15), scaler(21), scaler(22)});
  EXPECT_TRUE(list_attached().empty());
  EXPECT_EQ(opened("", 800, 600),
            "no camera is attached: plug it in (dtactctl cameras says why other video nodes are "
            "not taken)");
}

TEST(ListNodes, SaysWhyEachIsNotTaken) {
  EmulatedNode planes = kPort;
  planes.number = 5;
  planes.caps = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EmulatedNode output = scaler(13);
  output.caps = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  EmulatedNode raw = kPort;
  raw.number = 6;
  raw.fourcc = V4L2_PIX_FMT_SBGGR10;
  const EmulatedNodes nodes(
      {scaler(14), output, kCodec, raw, planes, kPipeline, kPort, kUsbMetadata, kUsb});
  std::string text;
  for (const Attached& node : list_nodes()) text += node.node + ": " + node.not_taken + "\n";
  EXPECT_EQ(text,
            "/dev/video0: \n"
            "/dev/video1: it delivers metadata, not images\n"
            "/dev/video2: it is not on USB, and a USB camera is there: set camera.v4l2.device = "
            "\"bus:platform:fe801000.csi\" to take it\n"
            "/dev/video3: its pipeline has to be set up first: use camera.backend = "
            "\"libcamera\"\n"
            "/dev/video5: it has only multi-planar buffers: use camera.backend = "
            "\"libcamera\"\n"
            "/dev/video6: it delivers no format that can be read (GREY, NV12, YUYV, MJPEG)\n"
            "/dev/video10: it converts images, as a codec does\n"
            "/dev/video13: it delivers no images\n"
            "/dev/video14: it has no video input: it converts what a program hands to it\n");
}

// A range has a lower and an upper bound for each direction.
TEST(ListModes, ReadsARangeOfSizes) {
  EmulatedNode any = kPort;
  any.width = any.height = 0;
  const EmulatedNodes nodes({any});
  const DeviceName::Opened camera = DeviceName("/dev/video2").open();
  const std::vector<Mode> modes = list_modes(camera.fd.get());
  ASSERT_EQ(modes.size(), 1U);
  EXPECT_EQ(modes[0].min_width, 64);
  EXPECT_EQ(modes[0].min_height, 48);
  EXPECT_EQ(modes[0].width, 16384);
  EXPECT_EQ(modes[0].height, 8192);
}

TEST(StableName, IsNeverALinkThatUdevIsStillMaking) {
  const EmulatedNodes nodes({kUsb});
  // A name of systemd's tempfn_random(), shorter than the link that it becomes.
  nodes.link("/dev/v4l/by-path/.#a0123456789abcdef", 0);
  nodes.link("/dev/v4l/by-id/.#a0123456789abcdef", 0);
  EXPECT_EQ(list_attached().at(0).by_path, "");
  EXPECT_EQ(list_attached().at(0).by_id, "");
  EXPECT_EQ(list_attached().at(0).stable_name(), "bus:usb-1");
  nodes.link("/dev/v4l/by-path/platform-xhci-usb-0:1:1.0-video-index0", 0);
  EXPECT_EQ(list_attached().at(0).stable_name(),
            "/dev/v4l/by-path/platform-xhci-usb-0:1:1.0-video-index0");
}

}  // namespace
}  // namespace dtact::hal::v4l2
