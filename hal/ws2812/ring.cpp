#include "hal/ws2812/ring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <stdexcept>
#include <utility>

namespace dtact::hal::ws2812 {
namespace {

constexpr std::chrono::milliseconds kFirstPause{250};
constexpr std::chrono::milliseconds kLongestPause{2000};

}  // namespace

Ring::Ring(RingParts parts, const Ws2812Config& config)
    : parts_(std::move(parts)), config_(config), dimming_{config.gamma, config.current_budget_ma} {
  (void)dim(Light{}, dimming_);  // throws for settings that no light could be shown with
  if (config_.first_led < 0 || config_.first_led >= kLedCount) {
    throw std::invalid_argument(fmt::format("ring.ws2812.first_led = {}: allowed are 0 … {}",
                                            config_.first_led, kLedCount - 1));
  }
  thread_ = base::RtThread({.name = "ring", .cpu = {}}, [this] { run(); });
  std::unique_lock lock(mutex_);
  written_.wait(lock, [this] { return looked_; });
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
  if (!outcome_.empty()) return {false, outcome_, dimmed.scale, report_.away};
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
  std::unique_lock lock(mutex_);
  while (true) {
    if (!wire_ && std::chrono::steady_clock::now() >= next_look_) look_for_ring(lock);
    wait(lock);
    const bool asked = asked_ != done_;
    if (!asked && stop_) break;
    if (wire_) {
      write(lock, Leds(wanted_));  // else than what was asked for: the timer's re-send
    } else if (asked) {
      answer(asked_, report_.message);
    }
  }
  if (wire_ && !config_.leave_on) write(lock, Leds{});
}

void Ring::look_for_ring(std::unique_lock<std::mutex>& lock) {
  lock.unlock();
  std::unique_ptr<Wire> wire;
  std::string refused;
  try {
    wire = parts_.open_wire();
    if (!power_ && parts_.switch_on) power_ = parts_.switch_on();
    refused = wire->prepare(kLedCount);
  } catch (const std::exception& e) {
    refused = e.what();
  }
  lock.lock();
  if (refused.empty()) {
    wire_ = std::move(wire);
    pause_ = {};
    report_.ok = true;
    report_.away = false;
    report_.message.clear();
    report_.note = wire_->note();
  } else {
    be_away(refused);
  }
  looked_ = true;
  written_.notify_all();
}

void Ring::be_away(const std::string& why) {
  wire_.reset();
  report_.ok = false;
  report_.away = true;
  report_.message = why;
  pause_ = std::clamp(2 * pause_, kFirstPause, kLongestPause);
  next_look_ = std::chrono::steady_clock::now() + pause_;
}

void Ring::wait(std::unique_lock<std::mutex>& lock) {
  const auto woken = [this] { return stop_ || asked_ != done_; };
  if (!wire_) {
    (void)wake_.wait_until(lock, next_look_, woken);
  } else if (config_.resend_ms > 0 && asked_ > 0) {
    (void)wake_.wait_for(lock, std::chrono::milliseconds(config_.resend_ms), woken);
  } else {
    wake_.wait(lock, woken);  // before the first show() there is nothing to repeat
  }
}

void Ring::write(std::unique_lock<std::mutex>& lock, const Leds& leds) {
  const std::uint64_t ticket = asked_;
  lock.unlock();
  const std::string error = wire_->send(leds);
  lock.lock();
  ++report_.writes;
  report_.failures += error.empty() ? 0U : 1U;
  report_.ok = error.empty();
  report_.message = error;
  report_.note = wire_->note();
  if (done_ != ticket) {  // else a re-send, which is nobody's command
    if (report_.ok) shown_ = leds;
    // The command has failed, so that the light before it is still the one to show.
    if (!report_.ok && shown_ && asked_ == ticket) wanted_ = *shown_;
  }
  if (!report_.ok && wire_->lost()) be_away(error);
  answer(ticket, error);
}

void Ring::answer(std::uint64_t ticket, const std::string& error) {
  if (done_ != ticket) {
    outcome_ = error;
    done_ = ticket;
  }
  written_.notify_all();
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
