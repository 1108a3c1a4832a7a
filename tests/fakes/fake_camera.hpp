#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/camera.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::fakes {

/// A camera that looks at the toy sensor, about 400 frames a second. Its scene and its faults are
/// set through the handle, from any thread, while it runs.
class FakeCamera final : public hal::Camera, private hal::FrameOwner {
 public:
  enum class Mode : std::uint8_t { streaming, silent, unplugged, ended };
  struct Handle {
    std::atomic<Mode> mode{Mode::streaming};
    std::atomic<int> lose{0};    ///< Frames to leave out before the next.
    std::atomic<int> damage{0};  ///< Frames to report as damaged.
    std::atomic<int> lent{0};    ///< Frames leased now.
    std::atomic<std::uint64_t> delivered{0};
    std::function<void(std::uint64_t)> on_grab;  ///< On the capture thread, with the count.
    hal::CameraInfo info{.backend = "fake",
                         .identity = "fake camera",
                         .pixel_format = "GREY",
                         .width = kToyWidth,
                         .height = kToyHeight,
                         .fps = 25,  // promised: even an emulator reaches it, so it is never slow
                         .light_delay_frames = 2,
                         .controls = {},
                         .settings = {}};
    bool refuse_start = false;

    void show(const ToyScene& scene) {
      const std::scoped_lock lock(mutex);
      scene_ = scene;
    }
    void light(double factor) {
      const std::scoped_lock lock(mutex);
      scene_.light = factor;
    }
    void press(double mm) {
      const std::scoped_lock lock(mutex);
      scene_.press_mm = mm;
    }
    [[nodiscard]] ToyScene scene() const {
      const std::scoped_lock lock(mutex);
      return scene_;
    }

   private:
    mutable std::mutex mutex;
    ToyScene scene_;
  };

  explicit FakeCamera(Handle& handle)
      : handle_(handle), pixels_(std::size_t{kToyWidth} * kToyHeight + hal::kLumaPadding) {}

  [[nodiscard]] hal::CameraInfo info() const override { return handle_.info; }
  [[nodiscard]] hal::CameraReport report() const override {
    hal::CameraReport report;
    report.delivered = handle_.delivered;
    if (handle_.mode != Mode::streaming) {
      report.state = hal::CameraState::unplugged;
      report.fix = "plug the fake camera in";
    }
    return report;
  }
  void start() override {
    if (handle_.refuse_start) throw std::runtime_error("fake camera: told not to start");
  }
  void will_read(const hal::Area& area) noexcept override { area_ = area; }
  [[nodiscard]] hal::GrabStatus grab(hal::Frame& out,
                                     std::chrono::nanoseconds timeout) noexcept override {
    using std::chrono::nanoseconds;
    if (handle_.on_grab) handle_.on_grab(handle_.delivered);
    switch (handle_.mode.load()) {
      case Mode::silent:
        std::this_thread::sleep_for(timeout);
        return hal::GrabStatus::timeout;
      case Mode::unplugged:
        return hal::GrabStatus::unplugged;
      case Mode::ended:
        return hal::GrabStatus::ended;
      case Mode::streaming:
        break;
    }
    std::this_thread::sleep_for(nanoseconds(2'500'000));
    if (handle_.damage > 0) {
      --handle_.damage;
      ++sequence_;
      return hal::GrabStatus::damaged;
    }
    const int lost = handle_.lose.exchange(0);
    sequence_ += static_cast<std::uint64_t>(lost);
    hal::FrameInfo frame;
    if (lost > 0) frame.flags = hal::kFrameAfterGap;
    frame.sequence = sequence_++;
    frame.timestamp_ns = base::system_clock().monotonic_ns();
    frame.ready_ns = frame.timestamp_ns;
    frame.meaning = hal::TimestampMeaning::start_of_exposure;
    toy_paint(handle_.scene(), frame.sequence, pixels_.data());
    blank_unread();
    ++handle_.lent;
    ++handle_.delivered;
    out = hal::Frame(*this, 0, {pixels_.data(), kToyWidth, kToyHeight, kToyWidth}, frame);
    return hal::GrabStatus::ok;
  }

 private:
  void give_back(int /*index*/) noexcept override { --handle_.lent; }

  /// Makes reading of unrequested pixels visible.
  void blank_unread() noexcept {
    for (int y = 0; y < kToyHeight; ++y) {
      for (int x = 0; x < kToyWidth; ++x) {
        const bool read =
            x >= area_.x && x < area_.x + area_.width && y >= area_.y && y < area_.y + area_.height;
        if (!read)
          pixels_[static_cast<std::size_t>(y) * kToyWidth + static_cast<std::size_t>(x)] = 0;
      }
    }
  }

  Handle& handle_;
  hal::Area area_{0, 0, kToyWidth, kToyHeight};
  std::vector<std::uint8_t> pixels_;
  std::uint64_t sequence_ = 0;
};

}  // namespace dtact::fakes
