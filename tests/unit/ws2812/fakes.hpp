#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/gpiod/lines.hpp"
#include "hal/ws2812/spi_port.hpp"

namespace dtact::hal::ws2812::test {

/// Time that passes by sleeping, by what the other fakes add, and by reading it.
class FakeClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override { return now += read_cost; }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override { return now; }
  void sleep_until(std::int64_t deadline_ns) noexcept override { now = std::max(now, deadline_ns); }
  mutable std::int64_t now = 1000;
  std::int64_t read_cost = 0;
};

/// An SPI controller that takes the wire's time at a rate of its own choosing.
class FakePort final : public SpiPort {
 public:
  explicit FakePort(FakeClock& clock) : clock_(clock) {}
  [[nodiscard]] std::string name() const override { return "/dev/fakespi"; }
  [[nodiscard]] std::size_t max_bytes() const override { return bufsiz; }
  [[nodiscard]] int transfer(std::span<const std::uint8_t> bytes) noexcept override {
    if (error != 0) return error;
    longest = std::max(longest, bytes.size());
    sent.assign(bytes.begin(), bytes.end());
    clock_.now += overhead_ns;
    if (hz > 0)
      clock_.now += static_cast<std::int64_t>(static_cast<double>(bytes.size()) * 8e9 / hz);
    return 0;
  }
  double hz = 3'200'000;
  std::int64_t overhead_ns = 80'000;
  std::size_t bufsiz = 4096;
  int error = 0;
  std::size_t longest = 0;
  std::vector<std::uint8_t> sent;

 private:
  FakeClock& clock_;
};

/// A GPIO line whose every call takes `cost_ns`, and which remembers its edges.
class FakeLine final : public gpiod::OutputLine {
 public:
  struct Event {
    bool high;
    std::int64_t at;
  };
  struct State {
    FakeClock clock;
    std::int64_t cost_ns = 50;
    int error = 0;
    /// Calls after which an interruption of `stall_ns` strikes, once each.
    std::vector<int> stalls;
    std::int64_t stall_ns = 20'000;
    int calls = 0;
    std::vector<Event> events;
  };
  explicit FakeLine(State& state) : state_(state) {}
  [[nodiscard]] int set(bool active) noexcept override {
    state_.clock.now += state_.cost_ns;
    if (std::find(state_.stalls.begin(), state_.stalls.end(), state_.calls++) !=
        state_.stalls.end()) {
      state_.clock.now += state_.stall_ns;
    }
    if (state_.error != 0) return state_.error;
    state_.events.push_back({active, state_.clock.now});
    return 0;
  }

 private:
  State& state_;
};

}  // namespace dtact::hal::ws2812::test
