#include "clients/ctl/cameras.hpp"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <sstream>

namespace dtact::ctl {
namespace {

hal::v4l2::SurveyedCamera camera() {
  hal::v4l2::SurveyedCamera c;
  c.attached.node = "/dev/video2";
  c.attached.by_path = "/dev/v4l/by-path/usb-0:1-video-index0";
  c.attached.serial = "4711";
  c.attached.bus = "usb-1";
  c.attached.card = "Finger";
  c.attached.driver = "uvcvideo";
  hal::v4l2::Mode mode;
  mode.fourcc = V4L2_PIX_FMT_MJPEG;
  mode.width = mode.min_width = 800;
  mode.height = mode.min_height = 600;
  mode.fps = {60.00024, 30};
  c.modes.push_back(mode);
  mode.fourcc = V4L2_PIX_FMT_H264;
  c.modes.push_back(mode);
  c.controls.push_back({"gain", 0, 100, 1, 5, 10});
  return c;
}

std::string printed(const std::vector<hal::v4l2::SurveyedCamera>& cameras, bool json,
                    bool terminal = false) {
  std::ostringstream out;
  print_cameras(cameras, json, terminal, out);
  return out.str();
}

// A USB device may call itself anything.
TEST(Cameras, GiveATerminalNoCommands) {
  hal::v4l2::SurveyedCamera hostile = camera();
  hostile.attached.card = "Fin\x1b]0;ger";
  hostile.attached.serial = "\x1b[2J";
  hostile.controls[0].name = "gain\x07";
  const std::string text = printed({hostile}, false);
  EXPECT_NE(text.find("Fin?]0;ger (uvcvideo)"), std::string::npos) << text;
  EXPECT_NE(text.find("serial:?[2J"), std::string::npos) << text;
  EXPECT_NE(text.find("gain? "), std::string::npos) << text;
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
}

TEST(Cameras, AreListedWithNamesModesAndControls) {
  EXPECT_EQ(printed({camera()}, false),
            "/dev/v4l/by-path/usb-0:1-video-index0\n"
            "  Finger (uvcvideo), /dev/video2 at present\n"
            "  or serial:4711, bus:usb-1\n"
            "  modes\n"
            "    MJPEG 800x600 at 60, 30\n"
            "    H264 800x600 at 60, 30 (not usable)\n"
            "  controls\n"
            "    gain                        0 to 100, step 1, default 5, now 10\n");
  EXPECT_EQ(
      printed({camera()}, true),
      R"({"cameras":[{"name":"/dev/v4l/by-path/usb-0:1-video-index0","node":"/dev/video2",)"
      R"("by_path":"/dev/v4l/by-path/usb-0:1-video-index0","by_id":"","serial":"4711",)"
      R"("bus":"usb-1","card":"Finger","driver":"uvcvideo","problem":"",)"
      R"("modes":[{"format":"MJPEG","usable":true,"width":800,"height":600,"min_width":800,)"
      R"("min_height":600,"fps_is_range":false,"fps":[60,30]},{"format":"H264","usable":false,)"
      R"("width":800,"height":600,"min_width":800,"min_height":600,"fps_is_range":false,)"
      R"("fps":[60,30]}],"controls":[{"name":"gain","minimum":0,"maximum":100,"step":1,)"
      R"("default":5,"value":10}],"not_taken":""}]})"
      "\n");
}

TEST(Cameras, NoneAndForbiddenOnes) {
  EXPECT_EQ(printed({}, false), "no camera is attached\n");
  EXPECT_EQ(printed({}, true), "{\"cameras\":[]}\n");
  hal::v4l2::SurveyedCamera forbidden;
  forbidden.attached.node = "/dev/video0";
  forbidden.attached.problem = "no permission to open /dev/video0: join the group";
  EXPECT_EQ(printed({forbidden}, false),
            "/dev/video0\n  no permission to open /dev/video0: join the group\n");
}

TEST(Cameras, WhatIsNotTakenComesLastAndGreyOnATerminal) {
  hal::v4l2::SurveyedCamera scaler;
  scaler.attached.node = "/dev/video14";
  scaler.attached.card = "bcm2835-isp";
  scaler.attached.not_taken = "it has no video input: it converts what a program hands to it";
  EXPECT_EQ(printed({scaler}, false),
            "no camera is attached\n"
            "not taken\n"
            "  /dev/video14 (bcm2835-isp): it has no video input: it converts what a program hands "
            "to it\n");
  const std::string text = printed({camera(), scaler}, false, true);
  EXPECT_EQ(
      text.substr(text.find("not taken")),
      "not taken\n"
      "\x1b[2m  /dev/video14 (bcm2835-isp): it has no video input: it converts what a program "
      "hands to it\x1b[22m\n");
  EXPECT_EQ(printed({camera(), scaler}, true, true).find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace dtact::ctl
