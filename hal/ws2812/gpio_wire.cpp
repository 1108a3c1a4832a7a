#include "hal/ws2812/gpio_wire.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace dtact::hal::ws2812 {
namespace {

constexpr int kDryRuns = 20;

std::int64_t median(std::vector<std::int64_t>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

GpioWire::GpioWire(std::unique_ptr<gpiod::OutputLine> line, std::string name, int retries,
                   base::Clock& clock, const PulseWindow& window)
    : line_(std::move(line)),
      name_(std::move(name)),
      retries_(retries),
      clock_(clock),
      window_(window) {}

std::string GpioWire::prepare(int leds) {
  // Every second bit a one, so that both pulses are measured.
  const std::vector<Rgb> pattern(static_cast<std::size_t>(leds), Rgb{0x55, 0x55, 0x55});
  pulses_.reserve(pattern.size() * 24);
  int clean = 0;
  for (int run = 0; run < kDryRuns; ++run) {
    if (!clock_out(pattern, true)) {
      return fmt::format("{}: the line cannot be driven ({}): use ring.backend = \"ws2812_spi\"",
                         name_, std::strerror(error_));
    }
    if (undisturbed()) ++clean;
  }
  if (clean == 0) {
    return fmt::format(
        "{}: this board is too slow to clock WS2812B by software: {}. Use the SPI controller: "
        "ring.backend = \"ws2812_spi\", with the LEDs' data line on MOSI",
        name_, figures());
  }
  if (clean < kDryRuns) {
    note_ = fmt::format("{}: {} of {} trial writes were disturbed; such a write is sent again",
                        name_, kDryRuns - clean, kDryRuns);
  }
  return {};
}

std::string GpioWire::send(std::span<const Rgb> leds) {
  for (int attempt = 0; attempt <= retries_; ++attempt) {
    if (attempt > 0) ++resent_;
    if (!clock_out(leds, false)) {
      return fmt::format("{}: the line cannot be driven: {}", name_, std::strerror(error_));
    }
    if (undisturbed()) return {};
  }
  return fmt::format(
      "{}: the write was disturbed {} times in a row, so the LEDs may show wrong colours: {}. "
      "Give the ring's thread a processor of its own (isolcpus) or use ring.backend = "
      "\"ws2812_spi\"",
      name_, retries_ + 1, figures());
}

bool GpioWire::clock_out(std::span<const Rgb> leds, bool quiet) noexcept {
  pulses_.clear();
  error_ = 0;
  drive(false);
  clock_.sleep_until(clock_.monotonic_ns() + window_.latch);
  fell_at_ = clock_.monotonic_ns();
  for (const Rgb& led : leds) {
    for (const std::uint8_t channel : {led.g, led.r, led.b}) {
      for (int bit = 7; bit >= 0; --bit) clock_bit((channel >> bit & 1) != 0, quiet);
    }
  }
  // The last low is the latch: nothing cuts it short.
  clock_.sleep_until(clock_.monotonic_ns() + window_.latch);
  return error_ == 0;
}

void GpioWire::clock_bit(bool one, bool quiet) noexcept {
  while (clock_.monotonic_ns() - fell_at_ < window_.low_wait) {
  }
  drive(!quiet);
  const std::int64_t rose_at = clock_.monotonic_ns();
  if (!pulses_.empty()) pulses_.back().low = rose_at - fell_at_;
  while (clock_.monotonic_ns() - rose_at < (one ? window_.one_wait : window_.zero_wait)) {
  }
  drive(false);
  fell_at_ = clock_.monotonic_ns();
  pulses_.push_back({one, fell_at_ - rose_at, 0});
}

void GpioWire::drive(bool high) noexcept {
  if (const int error = line_->set(high); error != 0 && error_ == 0) error_ = error;
}

bool GpioWire::undisturbed() const noexcept {
  return std::all_of(pulses_.begin(), pulses_.end(), [this](const Pulse& p) {
    const bool high_fits = p.one
                               ? p.high >= window_.one_high_min && p.high <= window_.one_high_max
                               : p.high >= window_.zero_high_min && p.high <= window_.zero_high_max;
    return high_fits && p.low <= window_.low_max;
  });
}

std::string GpioWire::figures() const {
  std::vector<std::int64_t> zeros;
  std::vector<std::int64_t> ones;
  std::int64_t low = 0;
  for (const Pulse& p : pulses_) {
    (p.one ? ones : zeros).push_back(p.high);
    low = std::max(low, p.low);
  }
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) / 1000; };
  const auto of = [&](std::vector<std::int64_t>& values, const char* name, std::int64_t least,
                      std::int64_t most) {
    if (values.empty()) return std::string();
    const auto [shortest, longest] = std::minmax_element(values.begin(), values.end());
    const double from = us(*shortest);
    const double to = us(*longest);
    return fmt::format(
        "a {}'s high pulse takes {:.2f} µs ({:.2f} … {:.2f}), allowed are "
        "{:.2f} … {:.2f}; ",
        name, us(median(values)), from, to, us(least), us(most));
  };
  return of(zeros, "0", window_.zero_high_min, window_.zero_high_max) +
         of(ones, "1", window_.one_high_min, window_.one_high_max) +
         fmt::format("the longest low {:.2f} µs, allowed {:.2f}", us(low), us(window_.low_max));
}

}  // namespace dtact::hal::ws2812
