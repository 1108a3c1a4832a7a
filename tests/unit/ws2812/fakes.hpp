#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/ws2812/spi_wire.hpp"

namespace dtact::hal::ws2812::test {

/// Time that passes by sleeping and by the delays of the other fakes.
class FakeClock final : public base::Clock {
 public:
  [[nodiscard]] std::int64_t monotonic_ns() const noexcept override { return now; }
  [[nodiscard]] std::int64_t wall_ns() const noexcept override { return now; }
  void sleep_until(std::int64_t deadline_ns) noexcept override { now = std::max(now, deadline_ns); }
  std::int64_t now = 1000;
};

/// An SPI controller that takes the wire's time at a rate of its own.
class FakePort final : public SpiPort {
 public:
  explicit FakePort(FakeClock& clock) : clock_(clock) {}
  [[nodiscard]] std::string name() const override { return "/dev/fakespi"; }
  [[nodiscard]] std::size_t max_bytes() const override { return bufsiz; }
  [[nodiscard]] int transfer(std::span<const std::uint8_t> bytes) noexcept override {
    if (error != 0) return error;
    longest = std::max(longest, bytes.size());
    sent.assign(bytes.begin(), bytes.end());
    if (sent != std::vector<std::uint8_t>(sent.size(), 0)) ++pictures;
    clock_.now += overhead_ns + (noise_ns ? noise_ns() : 0);
    const double rate = odd_hz.empty() ? hz : odd_hz.back();
    if (!odd_hz.empty()) odd_hz.pop_back();
    if (rate > 0)
      clock_.now += static_cast<std::int64_t>(static_cast<double>(bytes.size()) * 8e9 / rate);
    return 0;
  }
  double hz = 3'200'000;
  std::vector<double> odd_hz;              // rates of the transfers to come, before hz again
  std::function<std::int64_t()> noise_ns;  // delay of each by interruptions
  int pictures = 0;                        // transfers that were not only zeros
  std::int64_t overhead_ns = 80'000;
  std::size_t bufsiz = 4096;
  int error = 0;
  std::size_t longest = 0;
  std::vector<std::uint8_t> sent;

 private:
  FakeClock& clock_;
};

}  // namespace dtact::hal::ws2812::test
