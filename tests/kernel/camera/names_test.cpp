#include <fcntl.h>
#include <linux/videodev2.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include "hal/base/unique_fd.hpp"
#include "hal/v4l2/modes.hpp"
#include "hal/v4l2/node.hpp"
#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraState;
using hal::Frame;

/// Output of dtactctl cameras.
std::string listed() {
  FILE* pipe = ::popen(DTACT_DTACTCTL " cameras", "r");
  if (pipe == nullptr) throw std::runtime_error("cannot run " DTACT_DTACTCTL);
  std::string text;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  EXPECT_EQ(::pclose(pipe), 0);
  return text;
}

/// Names that udev gives. Needs a running udevd.
class Names : public GuestCamera {
 protected:
  static constexpr const char* kByPath =
      "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:1:1.0-video-index0";
  static constexpr const char* kById = "/dev/v4l/by-id/usb-Test_Fake_UVC_camera_0001-video-index0";

  /// udev removes a camera's links after its node; a name that is still there from the
  /// camera before would count as the next one's.
  void TearDown() override {
    GuestCamera::TearDown();
    EXPECT_TRUE(eventually(kTimeout, [] {
      return !std::filesystem::is_symlink(kByPath) && !std::filesystem::is_symlink(kById);
    }));
  }

  static void wait_for_links() {
    ASSERT_TRUE(eventually(kTimeout, [] {
      const auto cameras = hal::v4l2::list_attached();
      return cameras.size() == 1 && !cameras[0].by_path.empty() && !cameras[0].by_id.empty();
    }));
  }
};

TEST_F(Names, AreThoseOfUdev) {
  const UsbCamera usb({folder()});
  wait_for_links();
  const auto camera = hal::v4l2::list_attached().at(0);
  EXPECT_EQ(camera.by_path, kByPath);
  EXPECT_EQ(camera.by_id, kById);
  EXPECT_EQ(camera.serial, "0001");
  EXPECT_EQ(camera.bus, "usb-vhci_hcd.0-1");
  EXPECT_EQ(camera.stable_name(), kByPath);
}

TEST_F(Names, ACameraIsFoundAgainByPathAndById) {
  for (const char* name : {kByPath, kById}) {
    std::optional<UsbCamera> usb;
    usb.emplace(std::vector<std::string>{folder()});
    hal::CameraConfig c = config();
    c.v4l2.device = name;
    hal::v4l2::V4l2Camera camera(c);
    camera.start();
    Frame frame;
    grab_frame(camera, frame);
    EXPECT_EQ(camera.info().identity, name);
    usb.reset();
    grab_until_state(camera, CameraState::unplugged);
    usb.emplace(std::vector<std::string>{folder()});
    measured("by udev's link, re-plug to first frame", grab_frame(camera, frame), "s");
    ASSERT_GE(played().match_jpeg(frame.luma()), 0);
    usb.reset();
    wait_for_no_camera();
  }
}

TEST_F(Names, TheMetadataNodeSLinkIsRefused) {
  const UsbCamera usb({folder()});
  wait_for_links();
  hal::CameraConfig c = config();
  c.v4l2.device = "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:1:1.0-video-index1";
  ASSERT_TRUE(eventually(kTimeout, [&] { return std::filesystem::exists(c.v4l2.device); }));
  hal::v4l2::V4l2Camera camera(c);
  try {
    camera.start();
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("is not a capture node"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find(kByPath), std::string::npos) << e.what();
  }
}

TEST_F(Names, DtactctlListsTheCameraWithoutADaemon) {
  const UsbCamera usb({folder()});
  wait_for_links();
  const std::string text = listed();
  EXPECT_EQ(text.substr(0, text.find("  controls")),
            std::string(kByPath) +
                "\n"
                "  Fake UVC camera: Fake UVC camer (uvcvideo), /dev/video0 at present\n"
                "  or " +
                kById +
                ", serial:0001, bus:usb-vhci_hcd.0-1\n"
                "  modes\n"
                "    MJPEG 800x600 at 60, 30, 15\n"
                "    MJPEG 640x480 at 60, 30, 15\n"
                "    MJPEG 1280x720 at 60, 30, 15\n"
                "    YUYV 800x600 at 60, 30, 15\n"
                "    YUYV 640x480 at 60, 30, 15\n"
                "    YUYV 1280x720 at 60, 30, 15\n");
  EXPECT_NE(text.find("    exposure_time_absolute      1 to 10000, step 1, default 156, now 156\n"),
            std::string::npos)
      << text;
}

/// The same beside the nodes that a Pi 4 has without a camera. Needs pi-video-mock.
class PiNodes : public Names {
 protected:
  static hal::CameraConfig the_only_camera() {
    hal::CameraConfig c = config();
    c.v4l2.device.clear();
    return c;
  }
};

TEST_F(PiNodes, SayThatTheyCapture) {
  for (const char* node : {"/dev/video14", "/dev/video15", "/dev/video21", "/dev/video22"}) {
    const base::UniqueFd fd(::open(node, O_RDWR | O_CLOEXEC));
    v4l2_capability capability{};
    ASSERT_EQ(hal::v4l2::call(fd.get(), VIDIOC_QUERYCAP, capability), 0) << node;
    EXPECT_EQ(capability.device_caps, 0x04200001U) << node;
    EXPECT_TRUE(hal::v4l2::list_modes(fd.get()).at(1).offers(800, 600, 60)) << node;
  }
}

TEST_F(PiNodes, AreNoCamera) {
  wait_for_no_camera();
  hal::v4l2::V4l2Camera camera(the_only_camera());
  camera.start();
  EXPECT_EQ(camera.report().state, CameraState::unplugged);
  EXPECT_EQ(camera.report().fix,
            "no camera is attached: plug it in (dtactctl cameras says why other video nodes are "
            "not taken)");
  const UsbCamera usb({folder()});
  Frame frame;
  grab_frame(camera, frame);
  EXPECT_GE(played().match_jpeg(frame.luma()), 0);
}

TEST_F(PiNodes, AreListedWithTheReason) {
  const UsbCamera usb({folder()});
  wait_for_links();
  hal::v4l2::V4l2Camera camera(the_only_camera());
  camera.start();
  EXPECT_EQ(camera.info().identity, kByPath);
  ASSERT_TRUE(eventually(kTimeout, [] { return std::filesystem::exists("/dev/video1"); }));
  const std::string text = listed();
  EXPECT_TRUE(text.starts_with(kByPath)) << text;
  const std::string codec = "it converts images, as a codec does\n";
  const std::string scaler = "it has no video input: it converts what a program hands to it\n";
  EXPECT_EQ(text.substr(text.find("not taken")),
            "not taken\n"
            "  /dev/video1 (Fake UVC camera: Fake UVC camer): it delivers metadata, not images\n"
            "  /dev/video10 (bcm2835-codec-decode): " +
                codec + "  /dev/video11 (bcm2835-codec-encode): " + codec +
                "  /dev/video12 (bcm2835-codec-isp): " + codec +
                "  /dev/video13 (bcm2835-isp): it delivers no images\n"
                "  /dev/video14 (bcm2835-isp): " +
                scaler + "  /dev/video15 (bcm2835-isp): " + scaler +
                "  /dev/video16 (bcm2835-isp): it delivers metadata, not images\n"
                "  /dev/video18 (bcm2835-codec-image_fx): " +
                codec +
                "  /dev/video20 (bcm2835-isp): it delivers no images\n"
                "  /dev/video21 (bcm2835-isp): " +
                scaler + "  /dev/video22 (bcm2835-isp): " + scaler +
                "  /dev/video23 (bcm2835-isp): it delivers metadata, not images\n"
                "  /dev/video31 (bcm2835-codec-encode_image): " +
                codec);
}

}  // namespace
}  // namespace dtact::kernel_test
