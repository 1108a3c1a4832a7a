#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "daemon/pipeline/port.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::net::test {

/// Longer than any step on the slowest machine; a wait that reaches it has failed.
inline constexpr std::chrono::seconds kTimeout{60};

/// A pipeline that a test plays. The network thread uses the Port, the test the rest.
class FakePort : public pipeline::Port {
 public:
  // The Port.
  [[nodiscard]] int event_fd() const noexcept override { return fd_.get(); }
  [[nodiscard]] const pipeline::DepthFrame* latest() noexcept override {
    const std::lock_guard lock(mutex_);
    if (!fresh_.has_value()) return nullptr;
    current_ = *std::move(fresh_);
    fresh_.reset();
    changed_.notify_all();
    return &current_;
  }
  [[nodiscard]] std::optional<pipeline::Event> next_event() override {
    const std::lock_guard lock(mutex_);
    if (events_.empty()) return std::nullopt;
    auto event = std::move(events_.front());
    events_.pop_front();
    return event;
  }
  [[nodiscard]] bool submit(pipeline::Command command) override {
    {
      const std::lock_guard lock(mutex_);
      if (full_) return false;
      if (const auto* set = std::get_if<pipeline::SetLight>(&command.what)) {
        status_.light_requested = set->light;
      }
      commands_.push_back(command);
      changed_.notify_all();
    }
    if (answer_) {
      if (auto done = answer_(command)) emit(*std::move(done));
    }
    return true;
  }
  void want(pipeline::Wanted wanted) noexcept override {
    const std::lock_guard lock(mutex_);
    wanted_ = wanted;
    changed_.notify_all();
  }
  [[nodiscard]] pipeline::Status status() const override {
    const std::lock_guard lock(mutex_);
    ++status_calls_;
    changed_.notify_all();
    return status_;
  }

  [[nodiscard]] pipeline::UseCalibration prepare(
      const std::shared_ptr<const calibration::Calibration>& calibration,
      const pipeline::ReconstructionRules& /*rules*/) const override {
    check_fit();
    return {.calibration = calibration};
  }
  [[nodiscard]] pipeline::SetReconstruction prepare_maps(
      const std::shared_ptr<const calibration::Calibration>& /*in_use*/,
      const pipeline::ReconstructionRules& rules) const override {
    check_fit();
    return {.rules = rules};
  }

  // The test's side.
  void publish(pipeline::DepthFrame frame) {
    {
      const std::lock_guard lock(mutex_);
      fresh_ = std::move(frame);
    }
    ring();
  }
  void emit(pipeline::Event event) {
    {
      const std::lock_guard lock(mutex_);
      events_.push_back(std::move(event));
    }
    ring();
  }
  /// Sets how commands are answered at once; without it, not at all. Call before the server runs.
  void answer(std::function<std::optional<pipeline::CommandDone>(const pipeline::Command&)> f) {
    answer_ = std::move(f);
  }
  /// While true, nothing is prepared.
  void set_slow(bool slow) {
    const std::lock_guard lock(mutex_);
    slow_ = slow;
    changed_.notify_all();
  }
  /// Sets the reason why nothing can be prepared. Call before the server runs.
  void set_unfit(const std::string& why) { unfit_ = why; }
  void set_full(bool full) {
    const std::lock_guard lock(mutex_);
    full_ = full;
  }
  void set_status(pipeline::Status status) {
    const std::lock_guard lock(mutex_);
    status_ = std::move(status);
  }
  /// False when it does not happen within kTimeout.
  [[nodiscard]] bool wait_fetched() {
    return wait([this] { return !fresh_.has_value(); });
  }
  [[nodiscard]] bool wait_wanted(pipeline::Wanted wanted) {
    return wait([=, this] { return wanted_ == wanted; });
  }
  [[nodiscard]] bool wait_status_calls(int calls) {
    return wait([=, this] { return status_calls_ >= calls; });
  }
  /// The n-th command, counted from 0.
  [[nodiscard]] std::optional<pipeline::Command> wait_command(std::size_t n) {
    if (!wait([=, this] { return commands_.size() > n; })) return std::nullopt;
    const std::lock_guard lock(mutex_);
    return commands_[n];
  }

 private:
  void check_fit() const {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kTimeout, [this] { return !slow_; });
    if (!unfit_.empty()) throw std::invalid_argument(unfit_);
  }
  void ring() const {
    const std::uint64_t one = 1;
    (void)!::write(fd_.get(), &one, sizeof one);
  }
  template <typename Condition>
  bool wait(Condition condition) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kTimeout, condition);
  }

  base::UniqueFd fd_{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::optional<pipeline::DepthFrame> fresh_;
  pipeline::DepthFrame current_;
  std::deque<pipeline::Event> events_;
  std::vector<pipeline::Command> commands_;
  std::function<std::optional<pipeline::CommandDone>(const pipeline::Command&)> answer_;
  bool slow_ = false;
  std::string unfit_;
  bool full_ = false;
  pipeline::Wanted wanted_;
  mutable int status_calls_ = 0;
  pipeline::Status status_;
};

/// A frame whose pixels all hold the sequence number.
inline pipeline::DepthFrame make_frame(std::uint64_t sequence, int width = 8, int height = 4) {
  pipeline::DepthFrame frame;
  frame.camera.sequence = sequence;
  frame.has_depth = true;
  frame.width = width;
  frame.height = height;
  frame.mm_per_px = 0.05;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  frame.depth_um.assign(pixels, static_cast<std::int16_t>(sequence));
  frame.has_luma = true;
  frame.luma_width = width;
  frame.luma_height = height;
  frame.luma.assign(pixels, static_cast<std::uint8_t>(sequence));
  return frame;
}

}  // namespace dtact::net::test
