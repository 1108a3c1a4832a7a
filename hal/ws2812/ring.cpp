#include "hal/ws2812/ring.hpp"

#include <fmt/format.h>

#include <chrono>
#include <stdexcept>
#include <utility>

namespace dtact::hal::ws2812 {

Ring::Ring(std::unique_ptr<Wire> wire, std::unique_ptr<gpiod::PowerSwitch> power,
           const Ws2812Config& config, int priority)
    : power_(std::move(power)),
      wire_(std::move(wire)),
      config_(config),
      dimming_{config.gamma, config.current_budget_ma},
      info_(wire_->info()) {
  (void)dim(Light{}, dimming_);  // throws for settings that no light could be shown with
  if (config_.first_led < 0 || config_.first_led >= kLedCount) {
    throw std::invalid_argument(fmt::format("ring.ws2812.first_led = {}: allowed are 0 … {}",
                                            config_.first_led, kLedCount - 1));
  }
  thread_ =
      base::RtThread({.name = "ring", .cpu = {}, .fifo_priority = priority}, [this] { run(); });
  std::unique_lock lock(mutex_);
  written_.wait(lock, [this] { return prepared_; });
  for (const std::string& refused : thread_.refused()) {
    report_.note += (report_.note.empty() ? "" : "; ") + refused;
  }
  if (!report_.ok) {
    const std::string message = report_.message;
    lock.unlock();
    thread_.join();  // a wire that refused has ended the thread
    throw std::runtime_error(message);
  }
}

Ring::~Ring() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
  if (power_ && config_.leave_on) power_->leave_on();
}

ShowResult Ring::show(const Light& light) {
  const Dimmed dimmed = dim(light, dimming_);
  std::unique_lock lock(mutex_);
  wanted_ = in_chain_order(dimmed.leds);
  const std::uint64_t ticket = ++asked_;
  wake_.notify_one();
  written_.wait(lock, [&] { return done_ >= ticket; });
  if (!outcome_.empty()) return {false, outcome_, dimmed.scale};
  if (dimmed.scale >= 1) return {};
  return {true,
          fmt::format("dimmed to {:.0f} % of the light asked for, {:.0f} mA: "
                      "ring.ws2812.current_budget_ma = {:.0f}",
                      dimmed.scale * 100, dimmed.milliamps, config_.current_budget_ma),
          dimmed.scale};
}

RingReport Ring::report() const {
  const std::lock_guard lock(mutex_);
  return report_;
}

void Ring::run() {
  const std::string refused = wire_->prepare(kLedCount);
  std::unique_lock lock(mutex_);
  report_.ok = refused.empty();
  report_.message = refused;
  report_.note = wire_->note();
  prepared_ = true;
  written_.notify_all();
  if (!refused.empty()) return;

  const auto write = [&](const Leds& leds) {
    const std::uint64_t ticket = asked_;
    lock.unlock();
    std::string error = wire_->send(leds);
    lock.lock();
    ++report_.writes;
    report_.failures += error.empty() ? 0U : 1U;
    report_.ok = error.empty();
    report_.message = error;
    if (done_ != ticket) {  // else a re-send, which is nobody's command
      if (report_.ok) shown_ = leds;
      // The command has failed, so that the light before it is still the one to show.
      if (!report_.ok && shown_ && asked_ == ticket) wanted_ = *shown_;
      outcome_ = std::move(error);
      done_ = ticket;
    }
    written_.notify_all();
  };

  const auto period = std::chrono::milliseconds(config_.resend_ms);
  const auto woken = [this] { return stop_ || asked_ != done_; };
  while (true) {
    // Before the first show() there is nothing to repeat.
    if (config_.resend_ms > 0 && asked_ > 0) {
      (void)wake_.wait_for(lock, period, woken);
    } else {
      wake_.wait(lock, woken);
    }
    if (asked_ != done_) {
      write(Leds(wanted_));
    } else if (stop_) {
      break;
    } else {
      write(Leds(wanted_));  // the timer's re-send
    }
  }
  if (!config_.leave_on) write(Leds{});
}

Ring::Leds Ring::in_chain_order(const Leds& leds) const {
  Leds chain{};
  for (int i = 0; i < kLedCount; ++i) {
    const int step = config_.clockwise ? i : kLedCount - i;
    chain[static_cast<std::size_t>(i)] =
        leds[static_cast<std::size_t>((config_.first_led + step) % kLedCount)];
  }
  return chain;
}

}  // namespace dtact::hal::ws2812
