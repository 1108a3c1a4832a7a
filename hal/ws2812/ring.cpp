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
  look_for_ring();
}

Ring::~Ring() {
  if (wire_ && !config_.leave_on) (void)write(Leds{});
  if (power_ && config_.leave_on) power_->leave_on();
}

ShowResult Ring::show(const Light& light) {
  const DimmedLight dimmed = dim(light, dimming_);
  if (!wire_ && std::chrono::steady_clock::now() >= next_look_) look_for_ring();
  const std::string error = wire_ ? write(in_chain_order(dimmed.leds)) : report_.message;
  if (!error.empty()) return {false, error, report_.away};
  if (dimmed.scale >= 1) return {};
  return {true, fmt::format("dimmed to {:.0f} % of the light asked for, {:.0f} mA: "
                            "ring.ws2812.current_budget_ma = {:.0f}",
                            dimmed.scale * 100, dimmed.milliamps, config_.current_budget_ma)};
}

RingReport Ring::attend(const Light& light) {
  const Time now = std::chrono::steady_clock::now();
  if (!wire_ && now >= next_look_) {
    look_for_ring();
  } else if (wire_ && now >= next_send_) {
    (void)write(in_chain_order(dim(light, dimming_).leds));
  }
  report_.due = RingReport{}.due;
  if (wire_ && next_send_ != Time::max()) {
    report_.due = std::clamp<std::chrono::nanoseconds>(
        next_send_ - std::chrono::steady_clock::now(), {}, report_.due);
  }
  return report_;
}

void Ring::look_for_ring() {
  std::unique_ptr<Wire> wire;
  std::string refused;
  try {
    wire = parts_.open_wire();
    if (!power_ && parts_.switch_on) power_ = parts_.switch_on();
    refused = wire->prepare(kLedCount);
  } catch (const std::exception& e) {
    refused = e.what();
  }
  if (!refused.empty()) return be_away(refused);
  wire_ = std::move(wire);
  pause_ = {};
  report_.ok = true;
  report_.away = false;
  report_.message.clear();
  report_.note = wire_->note();
}

void Ring::be_away(const std::string& why) {
  wire_.reset();
  report_.ok = false;
  report_.away = true;
  report_.message = why;
  pause_ = std::clamp(2 * pause_, kFirstPause, kLongestPause);
  next_look_ = std::chrono::steady_clock::now() + pause_;
}

std::string Ring::write(const Leds& leds) {
  const std::string error = wire_->send(leds);
  if (config_.resend_ms > 0) {
    next_send_ = std::chrono::steady_clock::now() + std::chrono::milliseconds(config_.resend_ms);
  }
  ++report_.writes;
  report_.ok = error.empty();
  report_.message = error;
  report_.note = wire_->note();
  if (!report_.ok && wire_->lost()) be_away(error);
  return error;
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
