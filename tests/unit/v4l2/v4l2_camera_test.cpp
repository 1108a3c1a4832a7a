#include "hal/v4l2/v4l2_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "tests/unit/v4l2/emulated_camera.hpp"
#include "tests/unit/v4l2/small_camera.hpp"

namespace dtact::hal::v4l2 {
namespace {

using std::chrono::milliseconds;

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
  EXPECT_EQ(camera.report().fix, "");
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
  EXPECT_EQ(camera.report().damage_reason, "the payload's coded data is broken");
  buffer.payload = {0xFF, 0xD8, 0xFF, 0xDB, 0x00, 0x43};
  device.deliver(buffer);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  buffer.payload.clear();
  device.deliver(buffer);
  EXPECT_EQ(camera.grab(frame, milliseconds(1000)), GrabStatus::damaged);
  const DamageCounts damage = camera.report().damage;
  EXPECT_EQ(damage.undecodable + damage.markers, 2U);
  EXPECT_EQ(damage.too_short, 1U);
  EXPECT_EQ(camera.report().damage_reason, "") << "the newest was not even decoded";
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

// The emulated camera counts its exposure in 100 us, 1 to 1000 of them.
TEST(V4l2Camera, ChangesItsExposureAndKeepsItAcrossAReplug) {
  EmulatedCamera device;
  V4l2Camera camera(small());
  EXPECT_THROW(camera.change({.exposure_us = 4170, .gain = {}}),
               std::runtime_error);  // not there yet
  camera.start();
  const CameraSettings before = camera.info().settings;
  ASSERT_TRUE(before.exposure_us && before.gain);
  EXPECT_EQ(before.exposure_us->value, 15600);
  EXPECT_EQ(before.exposure_us->minimum, 100);
  EXPECT_EQ(before.exposure_us->maximum, 100000);
  EXPECT_EQ(before.gain->maximum, 100);
  camera.change({.exposure_us = 4170, .gain = {}});
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 42);
  EXPECT_EQ(device.control(V4L2_CID_GAIN), 5);
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4200);
  const auto controls = camera.info().controls;
  const auto entry = std::ranges::find(controls, "exposure_time_absolute", &CameraControl::name);
  ASSERT_NE(entry, controls.end());
  EXPECT_EQ(entry->value, 42);
  // The watching thread looks every second, and does not set it back.
  std::this_thread::sleep_for(milliseconds(1500));
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 42);
  EXPECT_EQ(camera.report().moved, "");

  device.fail(VIDIOC_DQBUF, ENODEV, 1);
  Frame frame;
  (void)camera.grab(frame, milliseconds(10));
  device.deliver_grey(7, 0);
  ASSERT_EQ(grab_soon(camera, frame), GrabStatus::ok);
  EXPECT_EQ(device.control(V4L2_CID_EXPOSURE_ABSOLUTE), 42);
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4200);

  device.refuse(V4L2_CID_EXPOSURE_ABSOLUTE);
  EXPECT_THROW(camera.change({.exposure_us = 8300, .gain = {}}), std::runtime_error);
  EXPECT_EQ(camera.info().settings.exposure_us->value, 4200);
}

}  // namespace
}  // namespace dtact::hal::v4l2
