#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "daemon/app/doctor/checks.hpp"

namespace dtact::app::test {

namespace fs = std::filesystem;

/// A machine made of a folder of files and of a few answers.
class FakeMachine : public Machine {
 public:
  FakeMachine() : Machine(make_folder()) {}
  ~FakeMachine() override { fs::remove_all(below_root("/")); }

  /// Returns the file's path on the real disk.
  fs::path file(const std::string& path, const std::string& text = "") {
    fs::create_directories(below_root(path).parent_path());
    std::ofstream(below_root(path)) << text;
    return below_root(path);
  }

  [[nodiscard]] int access(const std::string& path) const override {
    if (const auto found = denied.find(path); found != denied.end()) return found->second;
    return fs::exists(below_root(path)) ? 0 : ENOENT;
  }
  [[nodiscard]] std::string group(const std::string& /*path*/) const override { return owner; }
  [[nodiscard]] std::string user() const override { return opener; }
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
    return line == held_line ? holder : "";
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
  std::string opener = "anna";
  bool root = false;
  rlim_t rtprio = 90;
  rlim_t memlock = RLIM_INFINITY;
  std::map<std::string, Video> videos;
  SpiRate rate{3'200'000, {}};
  std::vector<hal::gpiod::Chip> chips{
      {"/dev/gpiochip0", "pinctrl-rp1", 54, {"GPIO0", "GPIO1"}, {}}};
  int held_line = -1;
  std::string holder = "\"lcd-reset\"";
  std::map<std::string, std::string> answers;  ///< The firmware's answers.
  std::vector<hal::v4l2::SurveyedCamera> attached;

 private:
  static fs::path make_folder() {
    std::string name = (fs::temp_directory_path() / "doctor_test.XXXXXX").string();
    return ::mkdtemp(name.data());
  }
};

/// The only finding whose verdict is not good.
inline Finding only_trouble(const Findings& findings) {
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

inline bool all_good(const Findings& findings) {
  return !findings.empty() && std::all_of(findings.begin(), findings.end(), [](const Finding& f) {
    return f.verdict == Verdict::good && f.fix.empty();
  });
}

inline hal::CameraConfig v4l2() {
  hal::CameraConfig camera;
  camera.backend = "v4l2";
  return camera;
}

inline hal::RingConfig spi_ring() {
  hal::RingConfig ring;
  ring.backend = "ws2812_spi";
  return ring;
}

/// A machine with everything that an SPI ring needs.
class SpiMachine : public FakeMachine {
 public:
  SpiMachine() {
    file("/dev/spidev0.0");
    file("/sys/module/spidev/parameters/bufsiz", "4096\n");
  }
};

class PiMachine : public FakeMachine {
 public:
  PiMachine() { file("/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0"); }
};

}  // namespace dtact::app::test
