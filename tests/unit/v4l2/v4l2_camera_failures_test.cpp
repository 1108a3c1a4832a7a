// Failures of each call of the camera's driver, and recovery.
#include <gtest/gtest.h>

#include <cerrno>
#include <utility>

#include "hal/v4l2/v4l2_camera.hpp"
#include "tests/unit/v4l2/emulated_camera.hpp"
#include "tests/unit/v4l2/small_camera.hpp"

namespace dtact::hal::v4l2 {
namespace {

using std::chrono::milliseconds;

struct StartFailure {
  unsigned long request;
  int error;
  CameraState state;
  const char* fix;
};

class StartFails : public testing::TestWithParam<StartFailure> {};

TEST_P(StartFails, IsAStateWithAFixAndPasses) {
  EmulatedCamera device;
  const StartFailure& p = GetParam();
  device.fail(p.request, p.error);
  CameraConfig c = small();
  c.v4l2.device = "/dev/video0";
  V4l2Camera camera(c);
  camera.start();
  EXPECT_EQ(camera.report().state, p.state);
  EXPECT_EQ(camera.report().fix, p.fix);
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
        // The unit's device filter. Before: the group, in which the user is already.
        StartFailure{VIDIOC_STREAMON, EPERM, CameraState::denied,
                     "no permission to open /dev/video0: the service's unit does not allow it: "
                     "restart the unit, which then takes the device's present number, or name it "
                     "in DeviceAllow= (systemctl edit)"},
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
  // Without a frame to deliver, QBUF would not be called.
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
