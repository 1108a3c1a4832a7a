#include "tests/e2e/besieged.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <utility>

#include "hal/base/clock.hpp"

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

HonestClient::HonestClient(client::Client client) : client_(std::move(client)) {
  client_.subscribe();
  thread_ = std::thread([this] { run(); });
}

HonestClient::~HonestClient() {
  stop_ = true;
  thread_.join();
}

void HonestClient::run() {
  try {
    while (!stop_) {
      const auto item = client_.next(std::chrono::milliseconds(200));
      if (!item || !std::holds_alternative<v1::Frame>(*item)) continue;
      const std::int64_t now_ns = base::system_clock().monotonic_ns();
      const std::lock_guard lock(mutex_);
      delays_ns_.push_back(now_ns - std::get<v1::Frame>(*item).monotonic_ns());
      ++frames_;
    }
  } catch (const std::exception& e) {
    const std::lock_guard lock(mutex_);
    broken_ = e.what();
  }
}

bool HonestClient::receives(std::size_t frames) const {
  const std::size_t wanted = frames_ + frames;
  return wait_for([&] { return frames_ >= wanted || !broken().empty(); }) && broken().empty();
}

double HonestClient::take_p99_ms() {
  const std::lock_guard lock(mutex_);
  auto delays = std::exchange(delays_ns_, {});
  if (delays.empty()) return std::nan("");
  std::ranges::sort(delays);
  return static_cast<double>(delays[(delays.size() - 1) * 99 / 100]) / 1e6;
}

std::string HonestClient::broken() const {
  const std::lock_guard lock(mutex_);
  return broken_;
}

Besieged::Besieged(const std::vector<std::string>& settings)
    : sensor_({}, true, settings), honest_(sensor_.connect("honest")) {}

Besieged::Missed Besieged::missed() const {
  const v1::Status status = sensor_.connect("asking").status();
  return {status.camera().lost(), status.camera().skipped(), status.skipped()};
}

void Besieged::begin() {
  ASSERT_TRUE(honest_.receives(30)) << honest_.broken();
  missed_before_ = missed();
  (void)honest_.take_p99_ms();
  ASSERT_TRUE(honest_.receives(120)) << honest_.broken();
  idle_p99_ms_ = honest_.take_p99_ms();
  before_ = held_by(pid());
  forget_peak(pid());
}

void Besieged::end(const std::string& attack) {
  // A short attack may be over between two frames.
  EXPECT_TRUE(honest_.receives(30)) << honest_.broken();
  const double attacked_p99_ms = honest_.take_p99_ms();
  const std::int64_t peak_kib = held_by(pid()).peak_kib;
  // Descriptors of peers close with their connections, the last of them after a time-out.
  EXPECT_TRUE(wait_for([&] { return held_by(pid()).descriptors <= before_.descriptors; }))
      << held_by(pid()).descriptors << " descriptors, before " << before_.descriptors;
  (void)wait_for(
      [&] { return held_by(pid()).resident_kib <= before_.resident_kib + kMemorySlackKib; });
  const Held after = held_by(pid());
  EXPECT_LE(after.resident_kib, before_.resident_kib + kMemorySlackKib);
  EXPECT_TRUE(honest_.receives(60)) << honest_.broken();
  const v1::Status status = sensor_.connect("newcomer").status();
  EXPECT_EQ(status.clients_size(), 2);
  const Missed now = missed();
  fmt::print(
      "{}: camera frames missed {} (lost {}, skipped {}), replaced {}; honest client's p99 {:.1f} "
      "ms, at rest {:.1f} ms; memory {:.1f} MiB, peak +{:.1f}, after {:+.1f}\n",
      attack, now.lost + now.skipped - missed_before_.lost - missed_before_.skipped,
      now.lost - missed_before_.lost, now.skipped - missed_before_.skipped,
      now.replaced - missed_before_.replaced, attacked_p99_ms, idle_p99_ms_,
      static_cast<double>(before_.resident_kib) / 1024,
      static_cast<double>(peak_kib - before_.resident_kib) / 1024,
      static_cast<double>(after.resident_kib - before_.resident_kib) / 1024);
  std::fflush(stdout);
}

}  // namespace dtact::e2e
