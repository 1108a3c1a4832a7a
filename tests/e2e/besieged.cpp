#include "tests/e2e/besieged.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <utility>

#include "hal/base/clock.hpp"
#include "tests/e2e/patience.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kTimeout{60};

/// "VmRSS:    1234 kB" of /proc/PID/status.
std::int64_t kib_of(const std::string& line) { return std::stoll(line.substr(line.find(':') + 1)); }

bool wait_for(const std::function<bool()>& flag) {
  for (const auto end = Clock::now() + kTimeout; Clock::now() < end;) {
    if (flag()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return flag();
}

/// With sanitizers the built-in scene's presses take a whole core to draw.
fs::path scene() { return kSlower == 1 ? fs::path() : scene_file("nothing.toml"); }

std::vector<std::string> at_test_rate(std::vector<std::string> settings) {
  settings.push_back(fmt::format("camera.fps={}", kFps));
  return settings;
}

/// Environment of the daemon: what the address sanitizer reads where it is built in.
Environment sanitizer_options() {
  return {{"ASAN_OPTIONS", fmt::format("quarantine_size_mb={}", kQuarantineMib)}};
}

}  // namespace

Held held_by(pid_t pid) {
  Held held;
  const fs::path process = fs::path("/proc") / std::to_string(pid);
  std::ifstream status(process / "status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) held.resident_kib = kib_of(line);
    if (line.starts_with("VmHWM:")) held.peak_kib = kib_of(line);
  }
  const fs::directory_iterator descriptors(process / "fd");
  held.descriptors = static_cast<int>(std::distance(begin(descriptors), end(descriptors)));
  return held;
}

void forget_peak(pid_t pid) { std::ofstream(fmt::format("/proc/{}/clear_refs", pid)) << "5\n"; }

HonestClients::HonestClients(client::Client viewer, client::Client commander) {
  const auto run = [this](auto serve, client::Client client) {
    return std::thread([this, serve, client = std::move(client)]() mutable {
      try {
        (this->*serve)(std::move(client));
      } catch (const std::exception& e) {
        const std::lock_guard lock(mutex_);
        broken_ = e.what();
      }
    });
  };
  viewer_ = run(&HonestClients::view, std::move(viewer));
  commander_ = run(&HonestClients::command, std::move(commander));
}

HonestClients::~HonestClients() {
  stop_ = true;
  viewer_.join();
  commander_.join();
}

void HonestClients::view(client::Client client) {
  client.subscribe();
  while (!stop_) {
    const auto item = client.next(std::chrono::milliseconds(200));
    if (!item || !std::holds_alternative<v1::Frame>(*item)) continue;
    const auto& frame = std::get<v1::Frame>(*item);
    const std::int64_t now_ns = base::system_clock().monotonic_ns();
    const std::lock_guard lock(mutex_);
    delays_ns_.push_back(now_ns - frame.monotonic_ns());
    served_.missed += frame.dropped() - std::exchange(dropped_, frame.dropped());
    ++frames_;
  }
}

void HonestClients::command(client::Client client) {
  v1::SetLight same;
  same.set_brightness(client.status().light().brightness());
  while (!stop_) {
    const std::uint64_t before = frames_;
    client.set_light(same);
    {
      const std::lock_guard lock(mutex_);
      served_.slowest = std::max(served_.slowest, frames_ - before);
      ++served_.commands;
    }
    ++commands_;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

bool HonestClients::receive(std::size_t frames) const {
  const std::uint64_t wanted = frames_ + frames;
  const std::uint64_t commands = commands_ + 1;
  return wait_for(
             [&] { return (frames_ >= wanted && commands_ >= commands) || !broken().empty(); }) &&
         broken().empty();
}

HonestClients::Served HonestClients::take() {
  const std::lock_guard lock(mutex_);
  Served served = std::exchange(served_, {});
  auto delays = std::exchange(delays_ns_, {});
  std::ranges::sort(delays);
  served.frames = delays.size();
  served.p99_ms = delays.empty()
                      ? std::nan("")
                      : static_cast<double>(delays[(delays.size() - 1) * 99 / 100]) / 1e6;
  return served;
}

std::string HonestClients::broken() const {
  const std::lock_guard lock(mutex_);
  return broken_;
}

Besieged::Besieged(const std::vector<std::string>& settings, const std::optional<client::Tls>& tls)
    : sensor_(scene(), true, at_test_rate(settings), sanitizer_options(), tls),
      honest_(sensor_.connect("honest"), sensor_.connect("commander")) {}

Besieged::~Besieged() { EXPECT_EQ(sensor_.daemon->stop(SIGTERM), 0) << sensor_.daemon->log(); }

Besieged::Missed Besieged::missed() const {
  const v1::Status status = sensor_.connect("asking").status();
  return {status.camera().lost(), status.camera().skipped(), status.skipped()};
}

void Besieged::begin() {
  ASSERT_TRUE(honest_.receive(30)) << honest_.broken();
  missed_before_ = missed();
  (void)honest_.take();
  ASSERT_TRUE(honest_.receive(120)) << honest_.broken();
  idle_p99_ms_ = honest_.take().p99_ms;
  if (at_rest_.descriptors == 0) at_rest_ = held_by(pid());
  forget_peak(pid());
}

void Besieged::end(const std::string& attack) {
  // A short attack may be over between two frames.
  EXPECT_TRUE(honest_.receive(30)) << honest_.broken();
  const HonestClients::Served served = honest_.take();
  EXPECT_GE(served.frames, 9 * served.missed) << "the honest viewer missed frames";
  EXPECT_LE(served.slowest, 30U) << "half a second at 60 frames a second";
  const std::int64_t peak_kib = held_by(pid()).peak_kib;
  EXPECT_LE(peak_kib, kMaxResidentKib);
  // Descriptors of peers close with their connections, the last of them after a time-out.
  EXPECT_TRUE(wait_for([&] { return held_by(pid()).descriptors <= at_rest_.descriptors; }))
      << held_by(pid()).descriptors << " descriptors, before " << at_rest_.descriptors;
  (void)wait_for(
      [&] { return held_by(pid()).resident_kib <= at_rest_.resident_kib + kMemorySlackKib; });
  const Held after = held_by(pid());
  EXPECT_LE(after.resident_kib, at_rest_.resident_kib + kMemorySlackKib);
  EXPECT_TRUE(honest_.receive(60)) << honest_.broken();
  const v1::Status status = sensor_.connect("newcomer").status();
  EXPECT_EQ(status.clients_size(), 3);
  const Missed now = missed();
  fmt::print(
      "{}: camera frames missed {} (lost {}, skipped {}), replaced {}; honest viewer missed {} of "
      "{}, p99 {:.1f} ms, at rest {:.1f} ms; the slowest of {} commands took {} frames; memory "
      "{:.1f} MiB, peak +{:.1f}, after {:+.1f}\n",
      attack, now.lost + now.skipped - missed_before_.lost - missed_before_.skipped,
      now.lost - missed_before_.lost, now.skipped - missed_before_.skipped,
      now.replaced - missed_before_.replaced, served.missed, served.frames + served.missed,
      served.p99_ms, idle_p99_ms_, served.commands, served.slowest,
      static_cast<double>(at_rest_.resident_kib) / 1024,
      static_cast<double>(peak_kib - at_rest_.resident_kib) / 1024,
      static_cast<double>(after.resident_kib - at_rest_.resident_kib) / 1024);
  std::fflush(stdout);
}

}  // namespace dtact::e2e
