#include "daemon/app/doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "daemon/app/doctor/checks.hpp"

namespace dtact::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

/// A machine made of a folder of files and of a few answers.
class FakeMachine : public Machine {
 public:
  FakeMachine() : Machine(make_folder()) {}
  ~FakeMachine() override { fs::remove_all(below_root("/")); }

  void file(const std::string& path, const std::string& text = "") {
    fs::create_directories(below_root(path).parent_path());
    std::ofstream(below_root(path)) << text;
  }

  [[nodiscard]] int access(const std::string& path) const override {
    if (const auto found = denied.find(path); found != denied.end()) return found->second;
    return fs::exists(below_root(path)) ? 0 : ENOENT;
  }
  [[nodiscard]] std::string group(const std::string& /*path*/) const override { return owner; }
  [[nodiscard]] std::string user() const override { return "anna"; }
  [[nodiscard]] bool privileged() const override { return root; }
  [[nodiscard]] rlim_t limit(int resource) const override {
    return resource == RLIMIT_RTPRIO ? rtprio : memlock;
  }
  [[nodiscard]] Video video(const std::string& path) const override { return videos.at(path); }
  [[nodiscard]] SpiRate spi_rate(const std::string& /*device*/,
                                 std::uint32_t /*asked_hz*/) const override {
    return rate;
  }
  [[nodiscard]] std::vector<hal::gpiod::Chip> gpio_chips() const override { return chips; }
  [[nodiscard]] std::string gpio_holder(const std::string& /*chip*/, int line) const override {
    return line == held_line ? "\"lcd-reset\"" : "";
  }
  [[nodiscard]] std::string firmware(const std::string& question) const override {
    const auto found = answers.find(question);
    return found == answers.end() ? "" : found->second;
  }
  [[nodiscard]] std::vector<hal::v4l2::SurveyedCamera> cameras() const override { return attached; }

  /// A camera that captures, as the kernel shows one on a USB port of that many Mbit/s.
  void usb_camera(const std::string& speed) {
    const std::string port = "/sys/devices/usb1/1-1";
    file("/dev/video0");
    file(port + "/speed", speed + "\n");
    file(port + "/1-1:1.0/uevent");
    const std::string node = "/sys/class/video4linux/video0";
    fs::create_directories(below_root(node));
    fs::remove(below_root(node + "/device"));
    fs::create_directory_symlink(below_root(port + "/1-1:1.0"), below_root(node + "/device"));
    videos = {{"/dev/video0", {true, "Endoscope", 0}}};
  }

  std::map<std::string, int> denied;
  std::string owner = "root";
  bool root = false;
  rlim_t rtprio = 90;
  rlim_t memlock = RLIM_INFINITY;
  std::map<std::string, Video> videos;
  SpiRate rate{3'200'000, {}};
  std::vector<hal::gpiod::Chip> chips{
      {"/dev/gpiochip0", "pinctrl-rp1", 54, {"GPIO0", "GPIO1"}, {}}};
  int held_line = -1;
  std::map<std::string, std::string> answers;  ///< Of the firmware.
  std::vector<hal::v4l2::SurveyedCamera> attached;

 private:
  static fs::path make_folder() {
    std::string name = (fs::temp_directory_path() / "doctor_test.XXXXXX").string();
    return ::mkdtemp(name.data());
  }
};

/// The only finding of a verdict other than good.
Finding only_trouble(const Findings& findings) {
  Finding trouble;
  int count = 0;
  for (const Finding& finding : findings) {
    if (finding.verdict == Verdict::good) continue;
    trouble = finding;
    ++count;
  }
  EXPECT_EQ(count, 1);
  return trouble;
}

bool all_good(const Findings& findings) {
  return !findings.empty() && std::all_of(findings.begin(), findings.end(), [](const Finding& f) {
    return f.verdict == Verdict::good && f.mend.empty();
  });
}

hal::CameraConfig v4l2() {
  hal::CameraConfig camera;
  camera.backend = "v4l2";
  return camera;
}

hal::RingConfig spi_ring() {
  hal::RingConfig ring;
  ring.backend = "ws2812_spi";
  return ring;
}

/// With everything that an SPI ring needs.
class SpiMachine : public FakeMachine {
 public:
  SpiMachine() {
    file("/dev/spidev0.0");
    file("/sys/module/spidev/parameters/bufsiz", "4096\n");
  }
};

TEST(DoctorCamera, ASimulatedCameraNeedsNoNode) {
  const FakeMachine machine;
  EXPECT_TRUE(all_good(check_camera(machine, hal::CameraConfig{})));
}

TEST(DoctorCamera, NoNodeIsWrongWhenOneIsNeeded) {
  const FakeMachine machine;
  const Finding finding = only_trouble(check_camera(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.mend, HasSubstr("modprobe uvcvideo"));
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

TEST(DoctorCamera, OnlyMetadataIsNoCamera) {
  FakeMachine machine;
  machine.file("/dev/video1");
  machine.videos = {{"/dev/video1", {false, "Endoscope", 0}}};
  EXPECT_EQ(only_trouble(check_camera(machine, v4l2())).what, "no video node captures");
}

TEST(DoctorCamera, AForbiddenNodeNamesTheGroup) {
  FakeMachine machine;
  machine.file("/dev/video0");
  machine.denied = {{"/dev/video0", EACCES}};
  machine.owner = "video";
  const Finding finding = only_trouble(check_camera(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_EQ(finding.mend, "sudo usermod -aG video anna, then log in again");
  // Nobody asked for a camera: worth knowing, not wrong.
  EXPECT_EQ(only_trouble(check_camera(machine, hal::CameraConfig{})).verdict, Verdict::note);
}

TEST(DoctorUsb, APortOfUsb1IsTooSlow) {
  FakeMachine machine;
  machine.usb_camera("12");
  const Finding finding = only_trouble(check_usb_speed(machine, v4l2()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_EQ(finding.what,
            "/dev/video0 is on a port of 12 Mbit/s: too slow for a stream of pictures");
  EXPECT_THAT(finding.mend, HasSubstr("lsusb -t"));
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
  EXPECT_THAT(finding.mend, HasSubstr("usermod -aG video anna"));
  machine.file("/dev/dma_heap/vidbuf_cached");
  EXPECT_TRUE(all_good(check_dma_heap(machine, camera)));
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
  EXPECT_THAT(only_trouble(check_spi(machine, spi_ring())).mend, HasSubstr("device tree"));
  // Device-tree strings end in a zero byte.
  machine.file("/proc/device-tree/model", std::string("Raspberry Pi 5 Model B Rev 1.0\0", 31));
  EXPECT_EQ(only_trouble(check_spi(machine, spi_ring())).mend,
            "sudo raspi-config nonint do_spi 0 && sudo reboot");
}

TEST(DoctorSpi, AForbiddenDeviceOfRootsNeedsTheRuleAndTheGroup) {
  SpiMachine machine;
  machine.denied = {{"/dev/spidev0.0", EACCES}};
  const Finding finding = only_trouble(check_spi(machine, spi_ring()));
  EXPECT_THAT(finding.what, HasSubstr("Permission denied"));
  EXPECT_THAT(finding.mend, HasSubstr("60-dtactd.rules"));
  EXPECT_THAT(finding.mend, HasSubstr("usermod -aG spi anna"));
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
  EXPECT_THAT(finding.mend, HasSubstr("spidev.bufsiz=4096"));
}

TEST(DoctorSpi, AWrongTrueRate) {
  SpiMachine machine;
  machine.rate = {2'000'000, {}};
  const Finding finding = only_trouble(check_spi(machine, spi_ring()));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("really sends 2.000 MHz"));
}

TEST(DoctorCoreClock, IsOfInterestOnARaspberryPi4) {
  SpiMachine machine;
  EXPECT_THAT(check_core_clock(machine, spi_ring()), IsEmpty());
  machine.file("/proc/device-tree/model", "Raspberry Pi 4 Model B Rev 1.4");
  machine.file("/boot/firmware/config.txt", "dtparam=spi=on\n#core_freq_min=500\n");
  const Finding finding = only_trouble(check_core_clock(machine, spi_ring()));
  EXPECT_EQ(finding.verdict, Verdict::note);
  EXPECT_THAT(finding.mend, HasSubstr("core_freq=500\\ncore_freq_min=500"));
  machine.answers = {{"measure_clock core", "frequency(1)=200000992"}};
  EXPECT_THAT(only_trouble(check_core_clock(machine, spi_ring())).what,
              HasSubstr("moves with load, now 200 MHz"));
  for (const char* config : {"core_freq=500\ncore_freq_min=500\n", "force_turbo=1\n"}) {
    machine.file("/boot/firmware/config.txt", config);
    EXPECT_TRUE(all_good(check_core_clock(machine, spi_ring()))) << config;
  }
  // What only begins so is another setting.
  machine.file("/boot/firmware/config.txt", "core_freq_min=5000\n");
  EXPECT_EQ(only_trouble(check_core_clock(machine, spi_ring())).verdict, Verdict::note);
  machine.file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0");
  EXPECT_THAT(check_core_clock(machine, spi_ring()), IsEmpty());
}

class PiMachine : public FakeMachine {
 public:
  PiMachine() { file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0"); }
};

TEST(DoctorPower, DecodesTheFirmwaresBits) {
  PiMachine machine;
  machine.answers = {{"get_throttled", "throttled=0x0"}};
  EXPECT_TRUE(all_good(check_throttling(machine)));
  // Throttled for under-voltage now; the processor's clock was capped before.
  machine.answers = {{"get_throttled", "throttled=0x70005"}};
  const Findings findings = check_throttling(machine);
  ASSERT_THAT(findings, SizeIs(3));
  EXPECT_EQ(findings[0].verdict, Verdict::wrong);
  EXPECT_EQ(findings[0].what, "throttled=0x70005: under-voltage now");
  EXPECT_THAT(findings[0].mend, HasSubstr("vcgencmd get_throttled"));
  EXPECT_EQ(findings[1].verdict, Verdict::note);
  EXPECT_EQ(findings[1].what, "throttled=0x70005: processor clock capped since the board started");
  EXPECT_EQ(findings[2].what, "throttled=0x70005: throttled now");
  machine.answers = {{"get_throttled", "throttled=0x80008"}};
  EXPECT_EQ(only_trouble(check_throttling(machine)).what,
            "throttled=0x80008: soft temperature limit now");
}

TEST(DoctorPower, IsAskedOfARaspberryPiOnly) {
  const FakeMachine other;
  EXPECT_THAT(check_throttling(other), IsEmpty());
  const PiMachine silent;
  EXPECT_EQ(only_trouble(check_throttling(silent)).verdict, Verdict::note);
}

TEST(DoctorGroups, AMissingOneIsNamed) {
  FakeMachine machine;
  machine.file("/etc/group", "root:x:0:\nvideo:x:44:anna\nspi:x:999:\nnotgpio:x:986:\n");
  const Finding finding = only_trouble(check_groups(machine));
  EXPECT_EQ(finding.what, "missing: gpio; the unit would not start (216/GROUP)");
  EXPECT_THAT(finding.mend, HasSubstr("systemd-sysusers"));
  machine.file("/etc/group", "gpio:x:986:\nvideo:x:44:anna\nspi:x:999:\n");
  EXPECT_TRUE(all_good(check_groups(machine)));
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
  machine.held_line = -1;
  machine.file("/dev/gpiochip0");
  machine.denied = {{"/dev/gpiochip0", EACCES}};
  EXPECT_THAT(only_trouble(check_gpio(machine, ring)).mend, HasSubstr("usermod -aG gpio anna"));
}

TEST(DoctorRealtime, LimitsOfAnUnprivilegedUser) {
  FakeMachine machine;
  EXPECT_TRUE(all_good(check_realtime(machine)));
  machine.rtprio = 0;
  EXPECT_THAT(only_trouble(check_realtime(machine)).mend, HasSubstr("echo 'anna - rtprio 90'"));
  machine.rtprio = 90;
  machine.memlock = 8U << 20U;
  EXPECT_THAT(only_trouble(check_realtime(machine)).what, HasSubstr("8192 kB"));
  machine.root = true;
  EXPECT_TRUE(all_good(check_realtime(machine)));
}

TEST(DoctorRealtime, TheShareOfAllRealTimeThreads) {
  FakeMachine machine;
  EXPECT_THAT(check_realtime_share(machine), IsEmpty());
  const auto set = [&](const char* runtime) {
    machine.file("/proc/sys/kernel/sched_rt_period_us", "1000000\n");
    machine.file("/proc/sys/kernel/sched_rt_runtime_us", runtime);
  };
  for (const char* good : {"950000\n", "-1\n"}) {
    set(good);
    EXPECT_TRUE(all_good(check_realtime_share(machine))) << good;
  }
  set("500000\n");
  EXPECT_EQ(only_trouble(check_realtime_share(machine)).verdict, Verdict::note);
  set("0\n");
  const Finding finding = only_trouble(check_realtime_share(machine));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.what, HasSubstr("sched_rt_runtime_us = 0 of 1000000"));
  EXPECT_THAT(finding.mend, HasSubstr("sudo sysctl"));
}

TEST(DoctorMemory, TooLittleIsNoted) {
  FakeMachine machine;
  machine.file("/proc/meminfo",
               "MemTotal:  4000000 kB\nMemFree: 20000 kB\nMemAvailable: 131072 kB\n");
  EXPECT_TRUE(all_good(check_memory(machine)));
  machine.file("/proc/meminfo", "MemTotal:  4000000 kB\nMemAvailable: 131071 kB\n");
  const Finding finding = only_trouble(check_memory(machine));
  EXPECT_EQ(finding.what, "127 MiB are available: too few for a daemon that locks its memory");
  EXPECT_THAT(finding.mend, HasSubstr("ps -eo rss"));
}

TEST(DoctorClock, AQuickSourceIsGood) {
  for (const std::string name : {"tsc", "arch_sys_counter", "kvm-clock"}) {
    FakeMachine machine;
    machine.file("/sys/devices/system/clocksource/clocksource0/current_clocksource", name + "\n");
    EXPECT_TRUE(all_good(check_clock_source(machine))) << name;
  }
}

TEST(DoctorClock, ASlowSourceIsWrongWhenAQuickOneIsThere) {
  FakeMachine machine;
  const std::string folder = "/sys/devices/system/clocksource/clocksource0/";
  machine.file(folder + "current_clocksource", "hpet\n");
  machine.file(folder + "available_clocksource", "hpet acpi_pm \n");
  EXPECT_EQ(only_trouble(check_clock_source(machine)).verdict, Verdict::note);
  machine.file(folder + "available_clocksource", "hpet tsc acpi_pm \n");
  const Finding finding = only_trouble(check_clock_source(machine));
  EXPECT_EQ(finding.verdict, Verdict::wrong);
  EXPECT_THAT(finding.mend, HasSubstr("echo tsc | sudo tee"));
}

TEST(DoctorClock, NoSourceFileIsANote) {
  const FakeMachine machine;
  EXPECT_EQ(only_trouble(check_clock_source(machine)).verdict, Verdict::note);
}

TEST(DoctorGovernor, AnyCpuThatIsNotAtFullClockIsNoted) {
  FakeMachine machine;
  EXPECT_TRUE(all_good(check_governor(machine)));
  machine.file("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n");
  EXPECT_TRUE(all_good(check_governor(machine)));
  machine.file("/sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "ondemand\n");
  const Finding finding = only_trouble(check_governor(machine));
  EXPECT_EQ(finding.verdict, Verdict::note);
  EXPECT_THAT(finding.what, HasSubstr("ondemand"));
}

TEST(Doctor, PrintsAReportAndAnExitStatusThatAgree) {
  std::ostringstream out;
  hal::Config config;
  config.ring = spi_ring();
  config.ring.ws2812.spi_device = "/dev/spidev-that-is-not-there";
  EXPECT_EQ(doctor(config, out), 1);
  EXPECT_THAT(out.str(),
              HasSubstr("spi          WRONG  /dev/spidev-that-is-not-there is not there"));
  EXPECT_THAT(out.str(), HasSubstr("mend:"));
  EXPECT_THAT(out.str(), HasSubstr("wrong\n"));
}

/// With what may be told, and with what may not.
class TellingMachine : public PiMachine {
 public:
  TellingMachine() {
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
    rtprio = 0;  // Its mend names the user.
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
  }
};

TEST(DoctorReport, SaysWhatTheMachineIsAndWhatIsWrong) {
  const TellingMachine machine;
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
  const TellingMachine machine;
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
}  // namespace dtact::app
