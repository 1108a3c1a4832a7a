#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "hal/v4l2/survey.hpp"
#include "tests/kernel/camera/guest_camera.hpp"

namespace dtact::kernel_test {
namespace {

using hal::CameraControl;
using hal::ControlVerdict;

struct Name {
  const char* camera;  ///< Name in uvcfake.
  const char* v4l2;
  /// uvcvideo asks for it before the setting, and so not after it: a part of a byte, or the value
  /// of an automatic.
  bool asked_before = false;
};

constexpr std::array<Name, 15> kNames{{
    {"exposure_mode", "auto_exposure", true},
    {"exposure_priority", "exposure_dynamic_framerate", true},
    {"exposure_time", "exposure_time_absolute"},
    {"focus", "focus_absolute", true},
    {"focus_auto", "focus_automatic_continuous", true},
    {"backlight", "backlight_compensation"},
    {"brightness", "brightness"},
    {"contrast", "contrast"},
    {"gain", "gain"},
    {"power_line", "power_line_frequency", true},
    {"saturation", "saturation"},
    {"sharpness", "sharpness"},
    {"gamma", "gamma"},
    {"white_balance", "white_balance_temperature"},
    {"white_balance_auto", "white_balance_automatic", true},
}};

using Verdicts = std::map<std::string, ControlVerdict>;

/// A camera that is asked for the first time since its plug and obeys.
Verdicts honest() {
  Verdicts verdicts;
  for (const Name& name : kNames) {
    verdicts[name.v4l2] = name.asked_before ? ControlVerdict::accepted : ControlVerdict::confirmed;
  }
  return verdicts;
}

/// Verdicts on the controls of a camera that lies, through the real uvcvideo.
class Controls : public GuestCamera {
 protected:
  /// Every control is set to another value than the camera's default.
  static hal::CameraConfig config() {
    hal::CameraConfig c = GuestCamera::config();
    c.v4l2.exposure_us = 5000;
    c.v4l2.controls = {{"focus_absolute", 100}, {"brightness", 5},
                       {"contrast", 40},        {"gain", 20},
                       {"saturation", 70},      {"sharpness", 5},
                       {"gamma", 120},          {"white_balance_temperature", 5000}};
    return c;
  }

  static std::vector<CameraControl> locked() {
    hal::v4l2::V4l2Camera camera(config());
    camera.start();
    EXPECT_EQ(camera.info().controls.size(), kNames.size()) << camera.report().fix;
    return camera.info().controls;
  }
  static Verdicts verdicts() {
    Verdicts found;
    for (const CameraControl& control : locked()) found[control.name] = control.verdict;
    return found;
  }

  /// One fault of all controls.
  static std::vector<std::string> every(const char* option) {
    std::vector<std::string> arguments;
    for (const Name& name : kNames) {
      arguments.emplace_back(option);
      arguments.emplace_back(name.camera);
    }
    arguments.push_back(folder());
    return arguments;
  }
};

TEST_F(Controls, OneThatKeepsItsValueIsNeverConfirmed) {
  for (const Name& name : kNames) {
    SCOPED_TRACE(name.v4l2);
    UsbCamera usb({"-k", name.camera, folder()});
    wait_for_camera();
    Verdicts expected = honest();
    if (!name.asked_before) expected[name.v4l2] = ControlVerdict::refused;
    EXPECT_EQ(verdicts(), expected);
    usb.unplug();
    wait_for_no_camera();
  }
}

TEST_F(Controls, OnesThatAreRefusedAreReportedWithWhatFollows) {
  const UsbCamera usb(every("-r"));
  wait_for_camera();
  for (const CameraControl& control : locked()) {
    EXPECT_EQ(control.verdict, ControlVerdict::refused) << control.name;
    if (control.name == "exposure_dynamic_framerate") {
      EXPECT_TRUE(control.note.ends_with(": in the dark the camera may halve its frame rate"))
          << control.note;
    }
    if (control.name == "power_line_frequency") {
      EXPECT_TRUE(
          control.note.ends_with(": the camera may keep its exposure to the mains, and the "
                                 "LEDs then show as bands"))
          << control.note;
    }
  }
}

// Only the picture could show otherwise.
TEST_F(Controls, WhatTheCameraConfirmsIsBelieved) {
  const UsbCamera usb(every("-l"));
  wait_for_camera();
  EXPECT_EQ(verdicts(), honest());
}

TEST_F(Controls, TheDriverSOwnAnswerConfirmsNothing) {
  Verdicts from_the_copy;
  for (const Name& name : kNames) from_the_copy[name.v4l2] = ControlVerdict::accepted;
  // This camera calls these AUTO_UPDATE.
  for (const char* name : {"exposure_time_absolute", "gain", "white_balance_temperature"}) {
    from_the_copy[name] = ControlVerdict::confirmed;
  }
  {
    UsbCamera usb({"-k", "gamma", folder()});
    wait_for_camera();
    EXPECT_EQ(verdicts()["gamma"], ControlVerdict::refused);
    // All handles are closed, and the copy stays.
    EXPECT_EQ(verdicts(), from_the_copy);
    usb.unplug();
    wait_for_no_camera();
  }
  const UsbCamera usb({folder()});
  wait_for_camera();
  ASSERT_EQ(hal::v4l2::survey_cameras().at(0).controls.size(), kNames.size());
  EXPECT_EQ(verdicts(), from_the_copy);  // another program has asked first
}

}  // namespace
}  // namespace dtact::kernel_test
