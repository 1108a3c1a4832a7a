// The doctor's findings about cameras, the ring and their device files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pwd.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "tests/unit/doctor/fake_machine.hpp"

namespace dtact::app::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST(DoctorCamera, ASimulatedCameraNeedsNoNode) {
  const FakeMachine machine;
  EXPECT_TRUE(all_good(check_camera(machine, hal::CameraConfig{})));
}

TEST(DoctorCamera, NoNodeIsWrongWhenOneIsNeeded) {
  const FakeMachine machine;
  const Finding finding = only_trouble(check_camera(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.fix, HasSubstr("modprobe uvcvideo"));
}

TEST(DoctorCamera, NamesTheNodeThatCapturesAndPassesOverMetadata) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.file("/dev/video1");
  machine.videos = {{"/dev/video0", {true, "Endoscope", 0}},
                    {"/dev/video1", {false, "Endoscope", 0}}};
  const Findings findings = check_camera(machine, v4l2());
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_EQ(findings[0].what, "/dev/video0 \"Endoscope\" captures");
  EXPECT_TRUE(all_good(findings));
}

TEST(DoctorCamera, AnotherCameraIsNotTheConfiguredOne) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.videos = {{"/dev/video0", {true, "Webcam", 0}}};
  hal::CameraConfig camera = v4l2();
  camera.v4l2.device = "/dev/v4l/by-path/none";
  const Finding finding = only_trouble(check_camera(machine, camera));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("camera.v4l2.device = \"/dev/v4l/by-path/none\""));
  EXPECT_THAT(finding.fix, HasSubstr("dtactctl cameras"));
}

TEST(DoctorCamera, AnotherCameraIsNotTheOneOfASerialNumberOrABus) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.videos = {{"/dev/video0", {true, "Webcam", 0}}};
  machine.attached.emplace_back().attached.serial = "4711";
  machine.attached.emplace_back().attached.bus = "usb-0000:00:14.0-2";
  hal::CameraConfig camera = v4l2();
  for (const char* name : {"serial:4711", "bus:usb-0000:00:14.0-2"}) {
    camera.v4l2.device = name;
    EXPECT_TRUE(all_good(check_camera(machine, camera))) << name;
  }
  for (const char* name : {"serial:0815", "bus:usb-0000:00:14.0-3", "serial:471"}) {
    camera.v4l2.device = name;
    const Finding finding = only_trouble(check_camera(machine, camera));
    EXPECT_EQ(finding.verdict, Verdict::wrong);
    EXPECT_EQ(finding.what, "the camera that camera.v4l2.device names is not attached")
        << "a report names no serial number";
    EXPECT_THAT(finding.fix, HasSubstr(name));
  }
}

TEST(DoctorCamera, OnlyMetadataIsNoCamera) {
  FakeMachine machine;
  machine.file("/dev/video1");
  machine.videos = {{"/dev/video1", {false, "Endoscope", 0}}};
  EXPECT_EQ(only_trouble(check_camera(machine, v4l2())).what, "no video node captures");
}

// bcm2835-isp registers these on a Raspberry Pi 4 (raspberrypi/linux pull 3565).
TEST(DoctorCamera, AnImageProcessorIsNoUsbCamera) {
  FakeMachine machine;
  machine.file("/dev/video14");
  machine.videos = {{"/dev/video14", {true, "bcm2835-isp", 0, false}}};
  const Findings findings = check_camera(machine, v4l2());
  EXPECT_EQ(findings[0].what, "/dev/video14 \"bcm2835-isp\" captures, on no USB port");
  EXPECT_EQ(only_trouble(findings).what, "none of them is a USB camera");
  machine.file("/dev/video0");
  machine.videos["/dev/video0"] = {true, "Endoscope", 0};
  EXPECT_TRUE(all_good(check_camera(machine, v4l2())));
}

TEST(DoctorCamera, AForbiddenNodeNamesTheGroup) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.denied = {{"/dev/video0", EACCES}};
  machine.owner = "video";
  const Finding finding = only_trouble(check_camera(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_EQ(finding.fix, "sudo usermod -aG video anna, then log in again");
  // No camera is configured: a note, not an error.
  EXPECT_EQ(only_trouble(check_camera(machine, hal::CameraConfig{})).verdict, Verdict::note);
}

// Root may open every node, so the check is made for the service's user.
TEST(DoctorCamera, ANodeThatTheServicesUserMayNotOpen) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.denied = {{"/dev/video0", EACCES}};
  machine.owner = "video";
  machine.opener = kServiceUser;
  EXPECT_EQ(only_trouble(check_camera(machine, v4l2())).fix,
            "sudo usermod -aG video dtactd && sudo systemctl restart dtactd");
}

TEST(DoctorAccess, IsByOwnerGroupAndMode) {
  FakeMachine machine;
  const fs::path node = machine.file("/dev/video0");
  const auto mode = [&node](unsigned bits) { fs::permissions(node, fs::perms(bits)); };
  EXPECT_EQ(access_as("nobody", node.string() + "-gone"), ENOENT);
  mode(0660);
  EXPECT_EQ(access_as("nobody", node), EACCES);
  mode(0664);
  EXPECT_EQ(access_as("nobody", node), EACCES);
  mode(0666);
  EXPECT_EQ(access_as("nobody", node), 0);
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  const struct passwd* const user = ::getpwnam("nobody");
  ASSERT_NE(user, nullptr);
  mode(0660);
  ASSERT_EQ(::chown(node.c_str(), 0, user->pw_gid), 0);
  EXPECT_EQ(access_as("nobody", node), 0);
  // The kernel checks only the owner's bits when the owner asks.
  mode(0066);
  ASSERT_EQ(::chown(node.c_str(), user->pw_uid, 0), 0);
  EXPECT_EQ(access_as("nobody", node), EACCES);
  mode(0600);
  EXPECT_EQ(access_as("nobody", node), 0);
}

TEST(DoctorUsb, APortOfUsb1IsTooSlow) {
  FakeMachine machine;
  machine.usb_camera("12");
  const Finding finding = only_trouble(check_usb_speed(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_EQ(finding.what,
            "/dev/video0 is on a port of 12 Mbit/s: too slow for a stream of pictures");
  EXPECT_THAT(finding.fix, HasSubstr("lsusb -t"));
}

TEST(DoctorUsb, RawPicturesHaveToFitIntoUsb2) {
  FakeMachine machine;
  machine.usb_camera("480");
  hal::CameraConfig camera = v4l2();  // 800x600 at 60 fps
  EXPECT_TRUE(all_good(check_usb_speed(machine, camera)));
  camera.v4l2.pixel_format = "yuyv";
  const Finding finding = only_trouble(check_usb_speed(machine, camera));
  EXPECT_EQ(finding.verdict, Verdict::note);
  // 800 · 600 pixels of two bytes, 60 times a second; 3 · 1024 bytes, 8000 times a second.
  EXPECT_THAT(finding.what, HasSubstr("carries up to 24.6 MB/s"));
  EXPECT_THAT(finding.what, HasSubstr("yuyv at 800x600 and 60 fps needs 57.6"));
  camera.fps = 25;
  EXPECT_TRUE(all_good(check_usb_speed(machine, camera)));
  camera.fps = 60;
  machine.usb_camera("5000");
  EXPECT_TRUE(all_good(check_usb_speed(machine, camera)));
}

TEST(DoctorUsb, OtherCamerasHaveNoPort) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.videos = {{"/dev/video0", {true, "vivid", 0}}};
  EXPECT_THAT(check_usb_speed(machine, v4l2()), IsEmpty());
  machine.usb_camera("12");
  EXPECT_THAT(check_usb_speed(machine, hal::CameraConfig{}), IsEmpty());
}

TEST(DoctorDmaHeap, IsForLibcameraAndMayBeMissing) {
  FakeMachine machine;
  EXPECT_THAT(check_dma_heap(machine, v4l2()), IsEmpty());
  hal::CameraConfig camera;
  camera.backend = "libcamera";
  EXPECT_THAT(only_trouble(check_dma_heap(machine, camera)).what,
              HasSubstr("no heap in /dev/dma_heap"));
  machine.file("/dev/dma_heap/linux,cma");
  machine.denied = {{"/dev/dma_heap/linux,cma", EACCES}};
  const Finding finding = only_trouble(check_dma_heap(machine, camera));
  EXPECT_EQ(finding.verdict, Verdict::note);
  EXPECT_THAT(finding.fix, HasSubstr("usermod -aG video anna"));
  machine.file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0");
  EXPECT_EQ(only_trouble(check_dma_heap(machine, camera)).verdict, Verdict::wrong);
  machine.file("/dev/dma_heap/vidbuf_cached");
  EXPECT_TRUE(all_good(check_dma_heap(machine, camera)));
}

TEST(DoctorIpa, IsForLibcameraAndMayBeMissing) {
  PiMachine machine;  // a Raspberry Pi 5
  EXPECT_THAT(check_ipa(machine, v4l2()), IsEmpty());
  hal::CameraConfig camera;
  camera.backend = "libcamera";
  Finding finding = only_trouble(check_ipa(machine, camera));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_EQ(finding.fix, "sudo apt install libcamera-ipa");
  // Debian 12's, which is older than the board.
  const std::string folder = "/usr/lib/aarch64-linux-gnu/libcamera/";
  machine.file(folder + "ipa_rpi.so");
  machine.file(folder + "ipa_rpi.so.sign");
  finding = only_trouble(check_ipa(machine, camera));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("ipa_rpi_pisp.so is not among"));
  machine.file("/proc/device-tree/model", "Raspberry Pi 4 Model B Rev 1.4");
  EXPECT_EQ(check_ipa(machine, camera).at(0).what, "libcamera has ipa_rpi.so");
  EXPECT_TRUE(all_good(check_ipa(machine, camera)));
  machine.file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0");
  machine.file(folder + "ipa/ipa_rpi_pisp.so");
  EXPECT_TRUE(all_good(check_ipa(machine, camera)));
  const FakeMachine other;
  EXPECT_EQ(only_trouble(check_ipa(other, camera)).verdict, Verdict::note);
}

TEST(DoctorSpi, NotNeededWithoutAnSpiRing) {
  const FakeMachine machine;
  EXPECT_TRUE(all_good(check_spi(machine, hal::RingConfig{})));
}

TEST(DoctorSpi, AllIsWell) {
  const SpiMachine machine;
  EXPECT_TRUE(all_good(check_spi(machine, spi_ring())));
}

TEST(DoctorSpi, AnAbsentDevice) {
  FakeMachine machine;
  EXPECT_THAT(only_trouble(check_spi(machine, spi_ring())).fix, HasSubstr("device tree"));
  // Device-tree strings end in a zero byte.
  machine.file("/proc/device-tree/model", std::string("Raspberry Pi 5 Model B Rev 1.0\0", 31));
  EXPECT_EQ(only_trouble(check_spi(machine, spi_ring())).fix,
            "sudo raspi-config nonint do_spi 0 && sudo reboot");
}

TEST(DoctorSpi, AForbiddenDeviceOfRootsNeedsTheRuleAndTheGroup) {
  SpiMachine machine;
  machine.denied = {{"/dev/spidev0.0", EACCES}};
  const Finding finding = only_trouble(check_spi(machine, spi_ring()));
  EXPECT_THAT(finding.what, HasSubstr("Permission denied"));
  EXPECT_THAT(finding.fix, HasSubstr("60-dtactd.rules"));
  EXPECT_THAT(finding.fix, HasSubstr("usermod -aG spi anna"));
  // The package installs it here.
  machine.file("/usr/lib/udev/rules.d/60-dtactd.rules");
  EXPECT_EQ(only_trouble(check_spi(machine, spi_ring())).fix,
            "sudo udevadm control --reload && sudo udevadm trigger && sudo usermod -aG spi anna, "
            "then log in again");
}

TEST(DoctorSpi, ASpeedOutsideTheWindow) {
  const SpiMachine machine;
  hal::RingConfig ring = spi_ring();
  ring.ws2812.spi_bits = 3;
  ring.ws2812.spi_hz = 2'400'000;
  const Findings findings = check_spi(machine, ring);
  ASSERT_FALSE(findings.empty());
  EXPECT_EQ(findings[0].verdict, Verdict::wrong);
  EXPECT_THAT(findings[0].what, HasSubstr("use 2.50 … 3.33 MHz"));
}

TEST(DoctorSpi, ASmallBufsiz) {
  SpiMachine machine;
  machine.file("/sys/module/spidev/parameters/bufsiz", "256\n");
  const Finding finding = only_trouble(check_spi(machine, spi_ring()));
  EXPECT_EQ(finding.what, "spidev.bufsiz = 256, the ring needs 336");
  EXPECT_THAT(finding.fix, HasSubstr("spidev.bufsiz=4096"));
}

TEST(DoctorSpi, AWrongTrueRate) {
  SpiMachine machine;
  machine.rate = {2'000'000, {}};
  const Finding finding = only_trouble(check_spi(machine, spi_ring()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("really sends 2.000 MHz"));
}

TEST(DoctorPio, TheDriversDevice) {
  hal::RingConfig ring;
  ring.backend = "ws2812_pio";
  PiMachine machine;
  EXPECT_THAT(check_pio(machine, spi_ring()), IsEmpty());
  const Finding absent = only_trouble(check_pio(machine, ring));
  EXPECT_EQ(absent.what, "/dev/leds0 is not there");
  EXPECT_THAT(absent.fix, HasSubstr("dtoverlay=ws2812-pio,gpio=18,num_leds=8"));
  const FakeMachine other;
  EXPECT_THAT(only_trouble(check_pio(other, ring)).fix, HasSubstr("ws2812_spi"));
  machine.file("/dev/leds0");
  EXPECT_TRUE(all_good(check_pio(machine, ring)));
  machine.denied = {{"/dev/leds0", EACCES}};
  EXPECT_THAT(only_trouble(check_pio(machine, ring)).fix, HasSubstr("usermod -aG gpio anna"));
}

TEST(DoctorGpio, NothingConfiguredNothingWrong) {
  const FakeMachine machine;
  EXPECT_TRUE(all_good(check_gpio(machine, spi_ring())));
}

TEST(DoctorGpio, LinesAreFoundByPathNameAndLabel) {
  const FakeMachine machine;
  hal::RingConfig ring = spi_ring();
  for (const std::string chip : {"/dev/gpiochip0", "gpiochip0", "pinctrl-rp1"}) {
    ring.ws2812.power = {chip, 17, false};
    EXPECT_TRUE(all_good(check_gpio(machine, ring))) << chip;
  }
  ring.backend = "ws2812_pio";
  ring.ws2812.power = {.name = "GPIO1"};
  EXPECT_TRUE(all_good(check_gpio(machine, ring)));
  ring.ws2812.power = {.name = "GPIO2"};
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).what, HasSubstr("no line has this name"));
}

TEST(DoctorGpio, WhatCanBeWrongWithALine) {
  FakeMachine machine;
  hal::RingConfig ring = spi_ring();
  ring.ws2812.power = {"gpiochip4", 17, false};
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).what, HasSubstr("no such chip"));
  ring.ws2812.power = {"gpiochip0", 54, false};
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).what, HasSubstr("lines 0 … 53"));
  ring.ws2812.power = {"gpiochip0", 27, false};
  machine.held_line = 27;
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).what, HasSubstr("in use by \"lcd-reset\""));
  // The service under test holds its own line.
  machine.holder = "\"dtactd\"";
  EXPECT_EQ(only_trouble(check_gpio(machine, ring)).verdict, Verdict::note);
  machine.held_line = -1;
  machine.file("/dev/gpiochip0");
  machine.denied = {{"/dev/gpiochip0", EACCES}};
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).fix, HasSubstr("usermod -aG gpio anna"));
}

}  // namespace
}  // namespace dtact::app::test
