#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <functional>
#include <string>

#include "hal/v4l2/finder.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#include "tests/kernel/camera/played_frames.hpp"
#include "tests/kernel/camera/usb_camera.hpp"

namespace dtact::kernel_test {

/// Much longer than any step takes: the guest has one CPU, and other programs use this machine.
inline constexpr double kTimeout = 20;

/// Common parts of the tests of the real uvcvideo.
class GuestCamera : public testing::Test {
 protected:
  /// 800×600 MJPEG at 60 frames a second of the camera with serial number 0001.
  [[nodiscard]] static hal::CameraConfig config() {
    hal::CameraConfig c;
    c.backend = "v4l2";
    c.width = PlayedFrames::kWidth;
    c.height = PlayedFrames::kHeight;
    c.fps = 60;
    c.v4l2.device = "serial:0001";
    c.v4l2.pixel_format = "mjpeg";
    return c;
  }

  /// A camera's nodes outlive its unplugging by a moment.
  void TearDown() override { wait_for_no_camera(); }

  /// The picture files, made once.
  [[nodiscard]] static const PlayedFrames& played() {
    static const PlayedFrames frames;
    return frames;
  }
  [[nodiscard]] static std::string folder() { return played().folder(); }

  /// Waits for the camera's node, so that a test of streaming doesn't test plugging.
  static void wait_for_camera(std::size_t count = 1) {
    ASSERT_TRUE(eventually(kTimeout, [&] { return hal::v4l2::list_attached().size() == count; }));
  }
  static void wait_for_no_camera() { wait_for_camera(0); }

  /// Grabs until `condition` holds. Fails the test when it takes too long. Returns the seconds.
  static double grab_until(hal::Camera& camera, hal::Frame& frame,
                           const std::function<bool(hal::GrabStatus)>& condition) {
    const double begin = now_s();
    for (;;) {
      const hal::GrabStatus status = camera.grab(frame, std::chrono::milliseconds(50));
      if (condition(status)) return now_s() - begin;
      if (now_s() - begin > kTimeout) {
        ADD_FAILURE() << "not within " << kTimeout << " s; fix: " << camera.report().fix;
        return kTimeout;
      }
    }
  }
  static double grab_frame(hal::Camera& camera, hal::Frame& frame) {
    return grab_until(camera, frame,
                      [](hal::GrabStatus status) { return status == hal::GrabStatus::ok; });
  }
  static double grab_until_state(hal::Camera& camera, hal::CameraState state) {
    hal::Frame frame;
    return grab_until(camera, frame,
                      [&](hal::GrabStatus) { return camera.report().state == state; });
  }

  /// Prints a measurement in the test's output.
  static void measured(const std::string& what, double value, const char* unit) {
    std::printf("measured (uvcvideo in User Mode Linux, simulated USB camera): %s %.3f %s\n",
                what.c_str(), value, unit);
  }
};

}  // namespace dtact::kernel_test
