// What the doctor prints, for the user of the machine and as a report for others.
#include "daemon/app/doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <sstream>
#include <string>

#include "tests/unit/doctor/fake_machine.hpp"

namespace dtact::app::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A machine with private names and numbers beside what a report may show.
class PrivateMachine : public PiMachine {
 public:
  PrivateMachine() {
    file("/proc/device-tree/serial-number", "10000000abcdef01");
    file("/etc/hostname", "annas-gripper\n");
    file("/etc/machine-id", "0123456789abcdef0123456789abcdef\n");
    file("/etc/os-release",
         "NAME=\"Debian GNU/Linux\"\nPRETTY_NAME=\"Debian GNU/Linux 13 (trixie)\"\n");
    file("/proc/sys/kernel/osrelease", "6.12.47+rpt-rpi-2712\n");
    file("/proc/sys/kernel/version", "#1 SMP PREEMPT Debian 1:6.12.47-1+rpt1 (2025-09-16)\n");
    file("/sys/devices/system/cpu/online", "0-3\n");
    file("/proc/meminfo", "MemTotal:        4147120 kB\nMemAvailable:    3500000 kB\n");
    file("/dev/video0");
    denied = {{"/dev/video0", EACCES}};
    rtprio = 0;  // Its fix names the user.
    answers = {{"get_throttled", "throttled=0x50000"}};
    hal::v4l2::SurveyedCamera& camera = attached.emplace_back();
    camera.attached.card = "USB Endoscope";
    camera.attached.driver = "uvcvideo";
    camera.attached.serial = "SN20250917";
    camera.attached.by_id = "/dev/v4l/by-id/usb-Maker_Endoscope_SN20250917-video-index0";
    hal::v4l2::Mode& mode = camera.modes.emplace_back();
    mode.fourcc = 0x47504a4d;  // "MJPG"
    mode.width = mode.min_width = 800;
    mode.height = mode.min_height = 600;
    mode.fps = {60, 30};
    hal::v4l2::SurveyedCamera& closed = attached.emplace_back();
    closed.attached.node = "/dev/video2";
    closed.attached.problem = "sudo usermod -aG video anna";
  }
};

TEST(Doctor, PrintsAReportAndAnExitStatusThatAgree) {
  std::ostringstream out;
  hal::Config config;
  config.ring = spi_ring();
  config.ring.ws2812.spi_device = "/dev/spidev-that-is-not-there";
  EXPECT_EQ(doctor(config, out), 1);
  EXPECT_THAT(out.str(),
              HasSubstr("spi          WRONG  /dev/spidev-that-is-not-there is not there"));
  EXPECT_THAT(out.str(), HasSubstr("fix:"));
  EXPECT_THAT(out.str(), HasSubstr("wrong\n"));
}

TEST(DoctorReport, SaysWhatTheMachineIsAndWhatIsWrong) {
  const PrivateMachine machine;
  hal::Config config;
  config.camera = v4l2();
  std::ostringstream out;
  report(config, out, machine);
  for (const char* line :
       {"board        Raspberry Pi 5 Model B Rev 1.0\n",
        "system       Debian GNU/Linux 13 (trixie)\n",
        "kernel       6.12.47+rpt-rpi-2712 #1 SMP PREEMPT Debian 1:6.12.47-1+rpt1 (2025-09-16) ",
        "processors   0-3\n", "memory       4147120 kB\n", "libcamera    ", "libgpiod     ",
        "configured   camera v4l2 800x600 at 60 fps, ring sim\n",
        "attached     USB Endoscope (uvcvideo): MJPEG 800x600 at 60, 30\n",
        "camera       WRONG  /dev/video0: Permission denied\n",
        "power        note   throttled=0x50000: under-voltage since the board started\n"}) {
    EXPECT_THAT(out.str(), HasSubstr(line));
  }
}

TEST(DoctorReport, NamesNobodyAndNoSerialNumber) {
  const PrivateMachine machine;
  hal::Config config;
  config.camera = v4l2();
  std::ostringstream out;
  report(config, out, machine);
  for (const char* secret :
       {"anna", "10000000abcdef01", "0123456789abcdef", "SN20250917", "by-id"}) {
    EXPECT_THAT(out.str(), Not(HasSubstr(secret)));
  }
}

}  // namespace
}  // namespace dtact::app::test
