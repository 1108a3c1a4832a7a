// The watchdog's input: the capture loop's heartbeat with a camera whose driver hangs.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "daemon/pipeline/pipeline.hpp"
#include "hal/base/clock.hpp"
#include "hal/live/live_camera.hpp"
#include "hal/live/source.hpp"
#include "tests/fakes/fake_ring.hpp"

namespace dtact::pipeline {
namespace {

using namespace std::chrono_literals;

/// A call of the driver that hangs on demand.
class Gate {
 public:
  void shut() {
    const std::scoped_lock lock(mutex_);
    shut_ = true;
  }
  void open() {
    const std::scoped_lock lock(mutex_);
    shut_ = false;
    changed_.notify_all();
  }
  /// The body of the driver's call.
  void pass() {
    std::unique_lock lock(mutex_);
    waiting_ = shut_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !shut_; });
    waiting_ = false;
  }
  /// Waits until a call hangs; false after a generous deadline.
  [[nodiscard]] bool somebody_waits() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, 30s, [this] { return waiting_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool shut_ = false;
  bool waiting_ = false;
};

/// A driver with a call for each way to hang.
struct Driver {
  Gate opening;
  Gate grabbing;
  Gate closing;
  std::atomic<bool> attached{true};
};

class DrivenSource final : public hal::live::Source {
 public:
  explicit DrivenSource(Driver& driver) : driver_(driver) {}

  [[nodiscard]] hal::live::Format format() const noexcept override {
    hal::live::Format f;
    f.width = f.height = kSide;
    f.bytes_per_line = kSide;
    return f;
  }
  void wait(std::int64_t deadline_ns) noexcept override {
    base::system_clock().sleep_until(std::min(deadline_ns, last_ns_ + kPeriodNs));
  }
  hal::live::DequeueStatus dequeue(hal::live::FilledBuffer& out) noexcept override {
    driver_.grabbing.pass();
    if (!driver_.attached) return hal::live::DequeueStatus::failed;
    const std::int64_t now_ns = base::system_clock().monotonic_ns();
    if (now_ns < last_ns_ + kPeriodNs) return hal::live::DequeueStatus::none;
    last_ns_ = now_ns;
    out.index = 0;
    out.payload = std::span(pixels_);
    out.sequence = sequence_++;
    out.timestamp_ns = now_ns;
    return hal::live::DequeueStatus::filled;
  }
  [[nodiscard]] int queued() const noexcept override { return 2; }
  bool enqueue(int /*index*/) noexcept override { return true; }
  void stop() noexcept override { driver_.closing.pass(); }
  std::string check_controls(std::vector<hal::CameraControl>& /*controls*/) override { return {}; }

  static constexpr int kSide = 160;

 private:
  static constexpr std::int64_t kPeriodNs = 10'000'000;

  Driver& driver_;
  std::array<std::uint8_t, std::size_t{kSide} * kSide> pixels_{};
  std::uint32_t sequence_ = 0;
  std::int64_t last_ns_ = 0;
};

class Heartbeat : public ::testing::Test {
 protected:
  Heartbeat() {
    hal::CameraConfig camera;
    camera.width = camera.height = DrivenSource::kSide;
    camera.fps = 100;
    PipelineConfig config;
    config.fifo_priority = 0;
    config.lock_memory = false;
    pipeline = std::make_unique<Pipeline>(
        std::make_unique<hal::live::LiveCamera>(camera, "driven", "driven",
                                                [this] {
                                                  driver.opening.pass();
                                                  return open();
                                                }),
        std::make_unique<fakes::FakeRing>(ring), nullptr, config);
    pipeline->start();
  }

 public:
  ~Heartbeat() override {
    driver.opening.open();
    driver.grabbing.open();
    driver.closing.open();
  }

 protected:
  hal::live::Opened open() {
    if (!driver.attached) throw hal::live::DeviceError(hal::CameraState::unplugged, "plug it in");
    return {std::make_shared<DrivenSource>(driver), "driven", "GREY", {}};
  }
  /// Whether it beats within half a second: five of the longest turns.
  [[nodiscard]] bool beats() const {
    const std::uint64_t before = pipeline->heartbeat();
    std::this_thread::sleep_for(500ms);
    return pipeline->heartbeat() != before;
  }
  /// The call behind `gate` hangs, the heartbeat stops, the call returns, the heartbeat resumes.
  void hang(Gate& gate) {
    ASSERT_TRUE(gate.somebody_waits());
    EXPECT_FALSE(beats());
    gate.open();
    EXPECT_TRUE(beats());
  }

  Driver driver;
  fakes::FakeRing::Handle ring;
  std::unique_ptr<Pipeline> pipeline;
};

TEST_F(Heartbeat, GoesOnWithAndWithoutACamera) {
  EXPECT_TRUE(beats());
  driver.attached = false;
  std::this_thread::sleep_for(100ms);
  EXPECT_TRUE(beats());
  EXPECT_EQ(pipeline->status().state, State::camera_lost);
}

TEST_F(Heartbeat, StandsStillWhileTheCameraHangsInGrab) {
  driver.grabbing.shut();
  hang(driver.grabbing);
}

TEST_F(Heartbeat, StandsStillWhileTheCameraHangsInClose) {
  driver.closing.shut();
  driver.attached = false;
  hang(driver.closing);
}

TEST_F(Heartbeat, StandsStillWhileTheCameraHangsInOpenAfterAnUnplug) {
  driver.opening.shut();
  driver.attached = false;
  hang(driver.opening);
}

}  // namespace
}  // namespace dtact::pipeline
