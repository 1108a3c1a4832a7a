#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraState;
using hal::Frame;
using std::chrono::milliseconds;

class Streaming : public GuestCamera {
 protected:
  /// 240 frames, each bit-equal to a picture, in the order in which they are played.
  static void stream(const hal::CameraConfig& c,
                     int (PlayedFrames::*match)(const hal::LumaView&) const) {
    hal::v4l2::V4l2Camera camera(c);
    camera.start();
    Frame frame;
    grab_frame(camera, frame);
    const std::uint64_t first = frame.info().sequence;
    const int first_picture = (played().*match)(frame.luma());
    ASSERT_GE(first_picture, 0);
    const std::int64_t first_ns = frame.info().timestamp_ns;
    std::int64_t decode_ns = 0;
    for (int i = 1; i < 240; ++i) {
      grab_frame(camera, frame);
      const auto step = static_cast<int>(frame.info().sequence - first);
      ASSERT_EQ((played().*match)(frame.luma()), (first_picture + step) % PlayedFrames::kCount)
          << "frame " << i;
      // uvcvideo claims start of exposure, and stamps the first packet.
      ASSERT_EQ(frame.info().meaning, hal::TimestampMeaning::first_packet);
      ASSERT_LE(frame.info().timestamp_ns, frame.info().ready_ns);
      decode_ns += frame.info().decode_ns;
    }
    const double seconds = static_cast<double>(frame.info().timestamp_ns - first_ns) * 1e-9;
    const hal::CameraReport report = camera.report();
    const auto frames = static_cast<double>(frame.info().sequence - first);
    measured(c.v4l2.pixel_format + " rate", frames / seconds, "frames/s");
    measured("decoding", static_cast<double>(decode_ns) / 239e6, "ms a frame");
    std::printf("delivered %lu, lost %lu, skipped %lu, damaged %lu\n", report.delivered,
                report.lost, report.skipped, report.damaged);
    EXPECT_EQ(report.damaged, 0U);
    EXPECT_EQ(report.disconnects, 0U);
    EXPECT_EQ(report.state, CameraState::streaming);
    EXPECT_EQ(report.delivered + report.skipped + report.lost,
              frame.info().sequence - first + 1 + (first - 1));
    // The rate is a measured figure; this only detects a standstill: a busy machine runs the guest
    // slowly.
    EXPECT_GT(frames / seconds, 5);
  }
};

TEST_F(Streaming, MjpegOverBulk) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  stream(config(), &PlayedFrames::match_jpeg);
}

TEST_F(Streaming, MjpegOverIsochronous) {
  const UsbCamera usb({"-i", folder()});
  wait_for_camera();
  stream(config(), &PlayedFrames::match_jpeg);
}

TEST_F(Streaming, YuyvOfLimitedRange) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = config();
  c.v4l2.pixel_format = "yuyv";
  stream(c, &PlayedFrames::match_yuyv);
}

TEST_F(Streaming, AutoPrefersUncompressedLuma) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = config();
  c.v4l2.pixel_format = "auto";
  c.v4l2.device.clear();  // the only camera
  hal::v4l2::V4l2Camera camera(c);
  camera.start();
  EXPECT_EQ(camera.info().pixel_format, "YUYV");
  EXPECT_EQ(camera.info().identity, "bus:usb-vhci_hcd.0-1");
}

TEST_F(Streaming, NamesWhatTheCameraOffers) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = config();
  c.width = 801;
  hal::v4l2::V4l2Camera camera(c);
  try {
    camera.start();
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(
        e.what(),
        "serial:0001 has no mode 801x600 at 60 frames a second in mjpeg: set camera.width, "
        "camera.height, camera.fps and camera.v4l2.pixel_format to one of: MJPEG 800x600 at 60, "
        "30, 15; MJPEG 640x480 at 60, 30, 15; MJPEG 1280x720 at 60, 30, 15; YUYV 800x600 at 60, "
        "30, 15; YUYV 640x480 at 60, 30, 15; YUYV 1280x720 at 60, 30, 15");
  }
}

TEST_F(Streaming, TwoCamerasAreDistinguishedBySerial) {
  const UsbCamera left({"-n", "left", "-p", "0", folder()});
  const UsbCamera right({"-n", "right", "-p", "1", folder()});
  wait_for_camera(2);
  hal::CameraConfig c = config();
  c.fps = 30;
  c.v4l2.device = "serial:left";
  hal::v4l2::V4l2Camera left_camera(c);
  c.v4l2.device = "serial:right";
  hal::v4l2::V4l2Camera right_camera(c);
  left_camera.start();
  right_camera.start();
  Frame a;
  Frame b;
  for (int i = 0; i < 60; ++i) {
    grab_frame(left_camera, a);
    grab_frame(right_camera, b);
    ASSERT_GE(played().match_jpeg(a.luma()), 0);
    ASSERT_GE(played().match_jpeg(b.luma()), 0);
  }
  EXPECT_EQ(left_camera.info().identity, "serial:left");

  c.v4l2.device.clear();
  hal::v4l2::V4l2Camera any(c);
  any.start();
  EXPECT_EQ(any.report().state, CameraState::unplugged);
  EXPECT_EQ(any.report().fix,
            "several cameras are attached and camera.v4l2.device = \"\" doesn't say which: set it "
            "to one of them (attached: bus:usb-vhci_hcd.0-1 (serial:left), bus:usb-vhci_hcd.0-2 "
            "(serial:right))");
}

TEST_F(Streaming, TheMetadataNodeIsNeverTaken) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = config();
  c.v4l2.device = "/dev/video1";
  ASSERT_TRUE(eventually(kTimeout, [] { return ::access("/dev/video1", F_OK) == 0; }));
  hal::v4l2::V4l2Camera camera(c);
  EXPECT_THROW(camera.start(), std::runtime_error);
  EXPECT_EQ(hal::v4l2::list_attached().size(), 1U);
}

TEST_F(Streaming, CutFramesAreDroppedAndCounted) {
  const UsbCamera usb({"-x", "5", folder()});
  wait_for_camera();
  hal::v4l2::V4l2Camera camera(config());
  camera.start();
  Frame frame;
  for (int i = 0; i < 120; ++i) {
    grab_frame(camera, frame);
    ASSERT_GE(played().match_jpeg(frame.luma()), 0) << "a broken frame came through";
  }
  const hal::CameraReport report = camera.report();
  EXPECT_GE(report.damage.markers, 20U);
  EXPECT_EQ(report.damage.markers, report.damaged);
}

TEST_F(Streaming, FramesThatTheDriverMarksAreDroppedAndCounted) {
  // By default uvcvideo drops marked frames, which then are gaps.
  constexpr const char* kNoDrop = "/sys/module/uvcvideo/parameters/nodrop";
  for (const bool nodrop : {false, true}) {
    std::ofstream(kNoDrop) << (nodrop ? "1" : "0") << std::flush;
    const UsbCamera usb({"-e", "5", folder()});
    wait_for_camera();
    {
      hal::v4l2::V4l2Camera camera(config());
      camera.start();
      Frame frame;
      int after_gap = 0;
      for (int i = 0; i < 60; ++i) {
        grab_frame(camera, frame);
        after_gap += (frame.info().flags & hal::kFrameAfterGap) != 0 ? 1 : 0;
      }
      const hal::CameraReport report = camera.report();
      EXPECT_EQ(report.damage.flagged, report.damaged);
      if (nodrop) {
        EXPECT_GE(report.damage.flagged, 10U);
      } else {
        EXPECT_EQ(report.damaged, 0U);
        EXPECT_GE(report.lost, 10U);
        EXPECT_GE(after_gap, 10);
      }
    }
  }
  std::ofstream(kNoDrop) << "0";
}

}  // namespace
}  // namespace dtact::kernel_test
