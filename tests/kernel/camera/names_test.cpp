#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraState;
using hal::Frame;

/// Names as udev gives them. Needs a running udevd.
class Names : public GuestCamera {
 protected:
  static constexpr const char* kByPath =
      "/dev/v4l/by-path/platform-vhci_hcd.0-usb-0:1:1.0-video-index0";
  static constexpr const char* kById = "/dev/v4l/by-id/usb-Test_Fake_UVC_camera_0001-video-index0";

  static void wait_for_links() {
    ASSERT_TRUE(eventually(kPatience, [] {
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
  ASSERT_TRUE(eventually(kPatience, [&] { return std::filesystem::exists(c.v4l2.device); }));
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
  FILE* pipe = ::popen(DTACT_DTACTCTL " cameras", "r");
  ASSERT_NE(pipe, nullptr);
  std::string text;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  EXPECT_EQ(::pclose(pipe), 0);
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

}  // namespace
}  // namespace dtact::kernel_test
