#include <fcntl.h>
#include <linux/v4l2-dv-timings.h>
#include <linux/videodev2.h>

#include "hal/base/unique_fd.hpp"
#include "hal/v4l2/node.hpp"
#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraState;
using hal::Frame;
using hal::GrabStatus;

/// The kernel's own virtual driver, loaded as /dev/video8 with an HDMI input. It is no camera, but
/// it injects faults that uvcvideo cannot be made to show.
class Vivid : public GuestCamera {
 protected:
  void SetUp() override {
    ASSERT_TRUE(eventually(kTimeout, [&] {
      fd_.reset(::open("/dev/video8", O_RDWR | O_CLOEXEC));
      return static_cast<bool>(fd_);
    }));
    // Built from the driver's own timings, since the kernel's macros for them are not C++.
    v4l2_enum_dv_timings offered{};
    do {
      ASSERT_EQ(hal::v4l2::call(fd_.get(), VIDIOC_ENUM_DV_TIMINGS, offered), 0);
      ++offered.index;
    } while (offered.timings.bt.width != 800 || offered.timings.bt.height != 600 ||
             offered.timings.bt.pixelclock != 40'000'000);  // 60 Hz
    ASSERT_EQ(hal::v4l2::call(fd_.get(), VIDIOC_S_DV_TIMINGS, offered.timings), 0);
    set("Test Pattern", 20);  // grey ramp
    set("OSD Text Mode", 2);  // none
  }

  void TearDown() override {}

  /// Sets a control by the name the driver gives it.
  void set(const std::string& name, int value) {
    v4l2_queryctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (hal::v4l2::call(fd_.get(), VIDIOC_QUERYCTRL, query) == 0) {
      if (reinterpret_cast<const char*>(query.name) == name.substr(0, 31)) {
        v4l2_control control{query.id, value};
        ASSERT_EQ(hal::v4l2::call(fd_.get(), VIDIOC_S_CTRL, control), 0) << name;
        return;
      }
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    FAIL() << "vivid has no control " << name;
  }

  [[nodiscard]] static hal::CameraConfig yuyv() {
    hal::CameraConfig c = config();
    c.v4l2.device = "/dev/video8";
    c.v4l2.pixel_format = "yuyv";
    return c;
  }

  base::UniqueFd fd_;
};

TEST_F(Vivid, YuyvOfLimitedRangeBecomesFullRangeLuma) {
  hal::v4l2::V4l2Camera camera(yuyv());
  camera.start();
  Frame frame;
  for (int i = 0; i < 60; ++i) grab_frame(camera, frame);
  const std::uint8_t* row = frame.luma().row(300);
  EXPECT_LE(row[0], 2);
  EXPECT_GE(row[799], 253);
  for (int x = 1; x < 800; ++x) ASSERT_GE(row[x], row[x - 1]) << x;
  // vivid returns a frame before its stated end, and a stamp in the future isn't believed.
  EXPECT_NE(frame.info().meaning, hal::TimestampMeaning::start_of_exposure);
  EXPECT_EQ(camera.report().damaged, 0U);
  set("Timestamp Source", 1);
  grab_until(camera, frame, [&](GrabStatus status) {
    return status == GrabStatus::ok &&
           frame.info().meaning == hal::TimestampMeaning::start_of_exposure;
  });
}

TEST_F(Vivid, Nv12AndGreyGiveTheSameLuma) {
  for (const char* format : {"nv12", "grey"}) {
    hal::CameraConfig c = yuyv();
    c.v4l2.pixel_format = format;
    c.v4l2.range = "limited";
    hal::v4l2::V4l2Camera camera(c);
    camera.start();
    Frame frame;
    grab_frame(camera, frame);
    const std::uint8_t* row = frame.luma().row(300);
    EXPECT_LE(row[0], 2) << format;
    EXPECT_GE(row[799], 253) << format;
  }
}

TEST_F(Vivid, MarkedBuffersAreDroppedAndCounted) {
  hal::v4l2::V4l2Camera camera(yuyv());
  camera.start();
  Frame frame;
  grab_frame(camera, frame);
  set("Inject V4L2_BUF_FLAG_ERROR", 1);
  // On a busy machine a whole frame follows the marked one: it is returned, and the
  // marked one only counted.
  grab_until(camera, frame, [&](GrabStatus) { return camera.report().damage.flagged >= 1; });
  grab_frame(camera, frame);
}

TEST_F(Vivid, DroppedBuffersAreCountedAsLost) {
  hal::v4l2::V4l2Camera camera(yuyv());
  camera.start();
  Frame frame;
  grab_frame(camera, frame);
  set("Percentage of Dropped Buffers", 30);
  bool marked = false;
  grab_until(camera, frame, [&](GrabStatus status) {
    marked =
        marked || (status == GrabStatus::ok && (frame.info().flags & hal::kFrameAfterGap) != 0);
    return marked && camera.report().lost > 5;
  });
  set("Percentage of Dropped Buffers", 0);
}

TEST_F(Vivid, AFatalStreamingErrorIsSurvived) {
  hal::v4l2::V4l2Camera camera(yuyv());
  camera.start();
  Frame frame;
  grab_frame(camera, frame);
  set("Inject Fatal Streaming Error", 1);
  grab_until_state(camera, CameraState::unplugged);
  grab_frame(camera, frame);
  EXPECT_EQ(camera.report().disconnects, 1U);
  EXPECT_EQ(camera.report().state, CameraState::streaming);
}

TEST_F(Vivid, ErrorsAtTheStartAreSurvived) {
  for (const char* fault : {"Inject VIDIOC_REQBUFS Error", "Inject VIDIOC_QBUF Error",
                            "Inject VIDIOC_STREAMON Error"}) {
    set(fault, 1);
    hal::v4l2::V4l2Camera camera(yuyv());
    camera.start();
    EXPECT_EQ(camera.report().state, CameraState::unplugged) << fault;
    Frame frame;
    grab_frame(camera, frame);  // the fault strikes once
  }
}

TEST_F(Vivid, ADisconnectIsSurvived) {
  hal::v4l2::V4l2Camera camera(yuyv());
  camera.start();
  Frame frame;
  grab_frame(camera, frame);
  set("Disconnect", 1);
  fd_.reset();  // vivid connects again when its last user closes it
  grab_until_state(camera, CameraState::unplugged);
  grab_frame(camera, frame);
  EXPECT_GE(camera.report().disconnects, 1U);
}

}  // namespace
}  // namespace dtact::kernel_test
