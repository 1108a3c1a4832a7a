#include "hal/v4l2/v4l2_camera.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <stdexcept>
#include <vector>

#include "tests/unit/v4l2/emulated_camera.hpp"

namespace dtact::hal::v4l2 {
namespace {

using std::chrono::milliseconds;

CameraConfig small() {
  CameraConfig c;
  c.width = EmulatedCamera::kWidth;
  c.height = EmulatedCamera::kHeight;
  c.fps = 60;
  c.v4l2.device = "serial:4711";
  return c;
}

/// Grabs until there is a frame; generous, since only order is tested.
GrabStatus grab_soon(V4l2Camera& camera, Frame& frame) {
  GrabStatus status = GrabStatus::timeout;
  for (int i = 0; i < 1000 && status != GrabStatus::ok; ++i) {
    status = camera.grab(frame, milliseconds(10));
  }
  return status;
}

TEST(V4l2Camera, ConvertsAndStampsAFrame) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  device.deliver_grey(77, 5);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().width, 32);
  EXPECT_EQ(frame.luma().height, 16);
  EXPECT_EQ(frame.luma().row(15)[31], 77);
  EXPECT_EQ(frame.info().meaning, TimestampMeaning::start_of_exposure);
  EXPECT_EQ(frame.info().flags, kFrameNormal);
  EXPECT_EQ(camera.info().pixel_format, "GREY");
  EXPECT_EQ(camera.info().identity, "serial:4711");
  EXPECT_EQ(camera.report().state, CameraState::streaming);
  EXPECT_EQ(camera.report().remedy, "");
}

// uvc_video_decode_start() takes the time as it decodes a frame's first packet, while the queue
// (uvc_queue.c) marks it V4L2_BUF_FLAG_TSTAMP_SRC_SOE.
TEST(V4l2Camera, StampsOfUvcvideoAreThoseOfTheFirstPacket) {
  EmulatedCamera device;
  device.set_driver("uvcvideo");
  V4l2Camera camera(small());
  camera.start();
  device.deliver_grey(77, 5);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.info().meaning, TimestampMeaning::first_packet);
  EmulatedBuffer at_the_end;
  at_the_end.payload.assign(512, 1);
  at_the_end.sequence = 6;
  at_the_end.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  device.deliver(at_the_end);
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.info().meaning, TimestampMeaning::end_of_frame);
}

TEST(V4l2Camera, TimesOutWithoutAFrame) {
  const EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(20)), GrabStatus::timeout);
  EXPECT_FALSE(frame);
}

TEST(V4l2Camera, TakesTheNewestAndCountsTheSkipped) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  for (std::uint8_t i = 0; i < 4; ++i) device.deliver_grey(i, i);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().row(0)[0], 3);
  EXPECT_EQ(camera.report().skipped, 3U);
  EXPECT_EQ(camera.report().delivered, 1U);
  EXPECT_EQ(camera.report().lost, 0U);
}

TEST(V4l2Camera, TheFrameHeldIsNotOverwritten) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  Frame frame;
  for (std::uint8_t i = 1; i < 20; ++i) {
    device.deliver_grey(i, i);
    Frame next;
    ASSERT_EQ(camera.grab(next, milliseconds(1000)), GrabStatus::ok);
    if (frame) {
      EXPECT_EQ(frame.luma().row(0)[0], i - 1);
    }
    frame = std::move(next);
  }
}

TEST(V4l2Camera, FallsBackToTheFrameBeforeADamagedOne) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  device.deliver_grey(10, 0);
  EmulatedBuffer marked;
  marked.payload.assign(512, 99);
  marked.sequence = 1;
  marked.flags |= V4L2_BUF_FLAG_ERROR;
  device.deliver(marked);
  EmulatedBuffer cut;
  cut.payload.assign(511, 98);
  cut.sequence = 2;
  device.deliver(cut);
  Frame frame;
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.luma().row(0)[0], 10);
  device.deliver(marked);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  const CameraReport report = camera.report();
  EXPECT_EQ(report.damage.flagged, 2U);
  EXPECT_EQ(report.damage.too_short, 1U);
  EXPECT_EQ(report.damaged, 3U);
}

TEST(V4l2Camera, CountsGapsAndMarksTheFrameAfter) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  Frame frame;
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> sequence_and_flags{
      {0, kFrameNormal},
      {1, kFrameNormal},
      {5, kFrameAfterGap},
      {6, kFrameNormal},
      {0, kFrameNormal}};  // the driver's count begins anew: no gap
  for (const auto& [sequence, flags] : sequence_and_flags) {
    device.deliver_grey(1, sequence);
    ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
    EXPECT_EQ(frame.info().flags, flags) << sequence;
  }
  EXPECT_EQ(camera.report().lost, 3U);
  EXPECT_EQ(frame.info().sequence, 8U);  // 1, 2, 6, 7, 8
}

TEST(V4l2Camera, BelievesOnlyPlausibleTimes) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  Frame frame;
  EmulatedBuffer buffer;
  buffer.payload.assign(512, 1);

  buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
  device.deliver(buffer);
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.info().meaning, TimestampMeaning::end_of_frame);

  buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  device.deliver(buffer);
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  EXPECT_EQ(frame.info().meaning, TimestampMeaning::arrival);

  buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  for (const std::int64_t us : {std::int64_t{0}, std::int64_t{1} << 50}) {
    buffer.timestamp_us = us;
    device.deliver(buffer);
    ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
    EXPECT_EQ(frame.info().meaning, TimestampMeaning::arrival);
  }
}

TEST(V4l2Camera, AnUndecodableJpegIsCountedByItsCause) {
  EmulatedCamera device;
  device.set_pixel_format(V4L2_PIX_FMT_MJPEG);
  V4l2Camera camera(small());
  camera.start();
  EXPECT_EQ(camera.info().pixel_format, "MJPEG");
  Frame frame;
  EmulatedBuffer buffer;
  buffer.payload = {0xFF, 0xD8, 0x00, 0xFF, 0xD9};  // both markers, nothing in between
  device.deliver(buffer);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  buffer.payload = {0xFF, 0xD8, 0xFF, 0xDB, 0x00, 0x43};
  device.deliver(buffer);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  buffer.payload.clear();
  device.deliver(buffer);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  const DamageCounts damage = camera.report().damage;
  EXPECT_EQ(damage.undecodable + damage.markers, 2U);
  EXPECT_EQ(damage.too_short, 1U);
}

struct StartFailure {
  unsigned long request;
  int error;
  CameraState state;
  const char* remedy;
};

class StartFails : public testing::TestWithParam<StartFailure> {};

TEST_P(StartFails, IsAStateWithARemedyAndPasses) {
  EmulatedCamera device;
  const StartFailure& p = GetParam();
  device.fail(p.request, p.error);
  CameraConfig c = small();
  c.v4l2.device = "/dev/video0";
  V4l2Camera camera(c);
  camera.start();
  EXPECT_EQ(camera.report().state, p.state);
  EXPECT_EQ(camera.report().remedy, p.remedy);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(1)), GrabStatus::unplugged);

  device.fail(p.request, 0);
  device.deliver_grey(9, 0);
  ASSERT_EQ(grab_soon(camera, frame), GrabStatus::ok);
  EXPECT_EQ(camera.report().state, CameraState::streaming);
  EXPECT_EQ(camera.report().disconnects, 0U);
}

constexpr const char* kBusy =
    "another program uses /dev/video0: end it (fuser -v /dev/video0 names it)";
constexpr const char* kDenied =
    "no permission to open /dev/video0: add the daemon's user to the group video (usermod -aG "
    "video USER) and start it again";

INSTANTIATE_TEST_SUITE_P(
    EachCall, StartFails,
    testing::Values(
        StartFailure{VIDIOC_QUERYCAP, ENODEV, CameraState::unplugged,
                     "cannot query /dev/video0 (No such device): plug the camera in again"},
        StartFailure{VIDIOC_S_FMT, EBUSY, CameraState::busy, kBusy},
        StartFailure{VIDIOC_S_FMT, EIO, CameraState::unplugged,
                     "cannot set the mode of /dev/video0 (Input/output error): plug the camera in "
                     "again"},
        StartFailure{VIDIOC_S_PARM, EIO, CameraState::unplugged,
                     "cannot set the frame rate of /dev/video0 (Input/output error): plug the "
                     "camera in again"},
        StartFailure{VIDIOC_S_PARM, EBUSY, CameraState::busy, kBusy},
        StartFailure{VIDIOC_REQBUFS, EBUSY, CameraState::busy, kBusy},
        StartFailure{VIDIOC_REQBUFS, ENOMEM, CameraState::unplugged,
                     "cannot get buffers of /dev/video0 (Cannot allocate memory): plug the camera "
                     "in again"},
        StartFailure{VIDIOC_QUERYBUF, EINVAL, CameraState::unplugged,
                     "cannot map buffers of /dev/video0 (Invalid argument): plug the camera in "
                     "again"},
        StartFailure{VIDIOC_QBUF, EIO, CameraState::unplugged,
                     "cannot queue buffers of /dev/video0 (Input/output error): plug the camera in "
                     "again"},
        StartFailure{VIDIOC_STREAMON, EBUSY, CameraState::busy, kBusy},
        StartFailure{VIDIOC_STREAMON, EACCES, CameraState::denied, kDenied},
        StartFailure{VIDIOC_STREAMON, ENOSPC, CameraState::busy,
                     "the USB bus of /dev/video0 has no bandwidth left: plug the camera into "
                     "another controller, or choose the pixel format mjpeg or a lower rate"}));

TEST(V4l2Camera, ASingleBufferIsNotEnough) {
  EmulatedCamera device;
  device.grant_buffers(1);
  V4l2Camera camera(small());
  camera.start();
  EXPECT_EQ(camera.report().state, CameraState::unplugged);
}

class StreamFails : public testing::TestWithParam<std::pair<unsigned long, int>> {};

TEST_P(StreamFails, CountsAsUnplugAndComesBack) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  Frame frame;
  device.deliver_grey(1, 7);
  ASSERT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
  const std::uint64_t before = frame.info().sequence;

  device.fail(GetParam().first, GetParam().second);
  // Without a frame to deliver, an error of QBUF would not be met.
  EmulatedBuffer marked;
  marked.flags |= V4L2_BUF_FLAG_ERROR;
  device.deliver(marked);
  EXPECT_EQ(camera.grab(frame, milliseconds(20)), GrabStatus::unplugged);
  EXPECT_EQ(camera.report().state, CameraState::unplugged);
  EXPECT_EQ(camera.report().disconnects, 1U);
  EXPECT_FALSE(device.streaming());

  device.fail(GetParam().first, 0);
  device.deliver_grey(2, 0);
  ASSERT_EQ(grab_soon(camera, frame), GrabStatus::ok);
  EXPECT_GT(frame.info().sequence, before);
  EXPECT_EQ(frame.info().flags, kFrameAfterGap | kFrameReopened);
  EXPECT_EQ(camera.report().state, CameraState::streaming);
}

INSTANTIATE_TEST_SUITE_P(EachError, StreamFails,
                         testing::Values(std::pair(VIDIOC_DQBUF, EIO),
                                         std::pair(VIDIOC_DQBUF, ENODEV),
                                         std::pair(VIDIOC_DQBUF, EINVAL),
                                         std::pair(VIDIOC_DQBUF, EPIPE),
                                         std::pair(VIDIOC_QBUF, ENODEV)));

TEST(V4l2Camera, ABufferThatDoesNotExistEndsTheStream) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  camera.start();
  EmulatedBuffer lying;
  lying.payload.assign(512, 1);
  lying.index_offset = 100;
  device.deliver(lying);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(20)), GrabStatus::unplugged);
}

TEST(V4l2Camera, AnInterruptedCallIsTriedAgain) {
  EmulatedCamera device;
  for (const unsigned long request : {VIDIOC_QUERYCAP, VIDIOC_S_FMT, VIDIOC_REQBUFS, VIDIOC_QBUF,
                                      VIDIOC_DQBUF, VIDIOC_STREAMON, VIDIOC_S_CTRL}) {
    device.fail(request, EINTR, 1);
  }
  V4l2Camera camera(small());
  camera.start();
  device.deliver_grey(1, 0);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
}

TEST(V4l2Camera, AModeTheDriverBendsIsAnErrorThatNamesTheOffer) {
  EmulatedCamera device;
  device.insist_on_width(64);
  V4l2Camera camera(small());
  try {
    camera.start();
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(),
                 "/dev/video0 runs GREY at 64x16 when asked for GREY at 32x16: set camera.width, "
                 "camera.height and camera.v4l2.pixel_format to one of: GREY 64x16");
  }
  device.insist_on_width(0);
  device.insist_on_rate(30);
  try {
    camera.start();
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(),
                 "/dev/video0 runs at 30.00 frames a second when asked for 60: set camera.fps, "
                 "camera.width, camera.height and camera.v4l2.pixel_format to one of: GREY 32x16 "
                 "at 30");
  }
}

TEST(V4l2Camera, KeepsWhatTheCameraSaidBeforeTheStream) {
  EmulatedCamera device;
  device.answer_from_a_copy(V4L2_CID_GAIN);
  device.ignore(V4L2_CID_GAIN);
  V4l2Camera camera(small());
  camera.start();
  const CameraInfo info = camera.info();
  ASSERT_EQ(info.controls.size(), 5U);
  EXPECT_EQ(info.controls[3].verdict, ControlVerdict::confirmed);
  EXPECT_EQ(info.controls[4].verdict, ControlVerdict::refused);
  EXPECT_EQ(info.controls[4].note, "gain is 60 after it was set to 5");
}

TEST(V4l2Camera, ToleratesHalfAFrameASecond) {
  EmulatedCamera device;
  device.insist_on_rate(61);
  CameraConfig config = small();
  config.fps = 60.4;  // offered: 60
  EXPECT_THROW(V4l2Camera(config).start(), std::runtime_error);
  config.fps = 60.5;
  EXPECT_NO_THROW(V4l2Camera(config).start());
}

TEST(V4l2Camera, ADriverWithoutRatesIsTakenAtItsWord) {
  EmulatedCamera device;
  device.fail(VIDIOC_ENUM_FRAMEINTERVALS, ENOTTY);
  device.fail(VIDIOC_S_PARM, ENOTTY);
  V4l2Camera camera(small());
  camera.start();
  device.deliver_grey(1, 0);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::ok);
}

TEST(V4l2Camera, LocksItsControlsAgainAfterALoss) {
  EmulatedCamera device;
  CameraConfig c = small();
  c.v4l2.exposure_us = 8000;
  V4l2Camera camera(c);
  camera.start();
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 80);
  EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);  // the camera's default
  device.fail(VIDIOC_DQBUF, EINVAL, 1);
  device.set_control(V4L2_CID_EXPOSURE_AUTO, 3);
  device.set_control(V4L2_CID_GAIN, 60);
  Frame frame;
  EXPECT_EQ(camera.grab(frame, milliseconds(1)), GrabStatus::unplugged);
  device.deliver_grey(1, 0);
  ASSERT_EQ(grab_soon(camera, frame), GrabStatus::ok);
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);
}

}  // namespace
}  // namespace dtact::hal::v4l2
