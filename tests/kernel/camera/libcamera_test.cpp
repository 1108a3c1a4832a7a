#include <map>
#include <optional>
#include <stdexcept>

#include "hal/libcamera/libcamera_camera.hpp"
#include "hal/v4l2/photometry.hpp"
#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraState;
using hal::Frame;

/// libcamera's own pipeline for USB cameras, on the real uvcvideo. Needs a running udevd and a
/// firmware node above the camera.
class Libcamera : public GuestCamera {
 protected:
  [[nodiscard]] static hal::CameraConfig libcamera_config(const char* format) {
    hal::CameraConfig c = config();
    c.backend = "libcamera";
    c.libcamera.pixel_format = format;
    return c;
  }

  [[nodiscard]] static std::int64_t value_of(const hal::Camera& camera, const std::string& name) {
    for (const hal::CameraControl& control : camera.info().controls) {
      if (control.name == name) return control.value;
    }
    ADD_FAILURE() << "no control " << name;
    return -1;
  }
};

TEST_F(Libcamera, StreamsMjpegByteForByte) {
  const UsbCamera usb({"-i", folder()});
  wait_for_camera();
  const auto camera = hal::libcamera_backend::make_camera(libcamera_config("mjpeg"));
  camera->start();
  Frame frame;
  measured("libcamera, start to first frame", grab_frame(*camera, frame), "s");
  EXPECT_EQ(camera->info().pixel_format, "MJPEG");
  EXPECT_EQ(camera->info().backend, "libcamera");
  // libcamera's exposure time stamp is uvcvideo's of the first packet.
  EXPECT_EQ(frame.info().meaning, hal::TimestampMeaning::first_packet);
  const double begin = now_s();
  for (int i = 0; i < 120; ++i) {
    grab_frame(*camera, frame);
    ASSERT_GE(played().match_jpeg(frame.luma()), 0) << i;
  }
  measured("libcamera MJPEG rate", 120 / (now_s() - begin), "frames/s");
  EXPECT_EQ(camera->report().damaged, 0U);
  EXPECT_EQ(camera->report().state, CameraState::streaming);
}

TEST_F(Libcamera, StreamsYuyv) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  const auto camera = hal::libcamera_backend::make_camera(libcamera_config("yuyv"));
  camera->start();
  Frame frame;
  for (int i = 0; i < 60; ++i) {
    grab_frame(*camera, frame);
    ASSERT_GE(played().match_yuyv(frame.luma()), 0) << i;
  }
  EXPECT_EQ(camera->info().pixel_format, "YUYV");
  // uvcvideo offers no full range and no rotation.
  EXPECT_EQ(value_of(*camera, "full_range"), 0);
  EXPECT_EQ(value_of(*camera, "orientation"), 1);
}

TEST_F(Libcamera, NamesWhatTheCameraOffers) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = libcamera_config("auto");
  c.width = 1024;
  const auto camera = hal::libcamera_backend::make_camera(c);
  try {
    const bool seen = eventually(kTimeout, [&] {
      camera->start();
      return false;
    });
    FAIL() << seen;
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("has no mode 1024x600"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("800x600"), std::string::npos) << e.what();
  }
}

TEST_F(Libcamera, LocksWhatTheCameraLets) {
  const UsbCamera usb({folder()});
  wait_for_camera();
  hal::CameraConfig c = libcamera_config("mjpeg");
  c.libcamera.exposure_us = 5000;
  c.libcamera.controls["lens_position"] = 1;
  const auto camera = hal::libcamera_backend::make_camera(c);
  camera->start();
  Frame frame;
  grab_frame(*camera, frame);
  // The request that reached the driver below.
  const auto opened = hal::v4l2::DeviceName("serial:0001").open();
  std::map<std::string, std::int64_t> values;
  for (const auto& control : hal::v4l2::list_controls(opened.fd.get())) {
    values[control.name] = control.value;
  }
  EXPECT_EQ(values.at("exposure_time_absolute"), 50);
  EXPECT_EQ(values.at("auto_exposure"), 1);
  bool missing = false;
  for (const hal::CameraControl& control : camera->info().controls) {
    missing = missing || control.note == "this camera has no lens_position";
  }
  EXPECT_TRUE(missing);
}

TEST_F(Libcamera, ComesBackAfterAnUnplug) {
  std::optional<UsbCamera> usb;
  usb.emplace(std::vector<std::string>{folder()});
  wait_for_camera();
  const auto camera = hal::libcamera_backend::make_camera(libcamera_config("mjpeg"));
  camera->start();
  Frame frame;
  // udev reports a camera's nodes in any order, a different one each time.
  for (int cycle = 0; cycle < 5; ++cycle) {
    grab_frame(*camera, frame);
    usb.reset();
    measured("libcamera, unplug to unplugged state",
             grab_until_state(*camera, CameraState::unplugged), "s");
    wait_for_no_camera();
    // Once it is away for so long that the search becomes slow.
    if (cycle == 0) {
      const double later = now_s() + 5;
      grab_until(*camera, frame, [later](hal::GrabStatus) { return now_s() > later; });
    }
    usb.emplace(std::vector<std::string>{folder()});
    measured("libcamera, re-plug to first frame", grab_frame(*camera, frame), "s");
    ASSERT_GE(played().match_jpeg(frame.luma()), 0);
  }
}

}  // namespace
}  // namespace dtact::kernel_test
