#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/gpiod/lines.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// The pulses a GPIO line must make, nanoseconds: how long to wait before the call that ends a
/// pulse, and the window in which a measured pulse counts as right (encoder.hpp has its origin).
struct PulseWindow {
  std::int64_t zero_wait = 200, zero_high_min = 200, zero_high_max = 400;
  std::int64_t one_wait = 700, one_high_min = 600, one_high_max = 1000;
  /// Some WS2812B latch after 6 µs of low already, whatever the datasheet says
  /// (https://cpldcpu.wordpress.com/2014/01/14/light_ws2812-library-v2-0-part-i-understanding-the-ws2812/).
  std::int64_t low_wait = 400, low_max = 5000;
  std::int64_t latch = 300'000;
};

/// WS2812B clocked by software on one GPIO line. A pulse lasts from the return of the call that
/// raises the line to the return of the one that lowers it, which is exact as far as every call
/// takes the same time. Between two system calls little happens in 0.4 µs: most boards are too
/// slow, and prepare() says so with figures. On a board that can, an interrupt still stretches a
/// pulse now and then; the measured pulses show it, and the write is sent again.
class GpioWire final : public Wire {
 public:
  /// `retries`: times a disturbed write is sent again before it counts as failed.
  GpioWire(std::unique_ptr<gpiod::OutputLine> line, std::string name, int retries,
           base::Clock& clock = base::system_clock(), const PulseWindow& window = {});

  [[nodiscard]] RingInfo info() const override { return {"ws2812_gpio", name_}; }
  /// Clocks dark frames with the line held low, measuring as if it moved.
  [[nodiscard]] std::string prepare(int leds) override;
  [[nodiscard]] std::string note() const override { return note_; }
  [[nodiscard]] std::string send(std::span<const Rgb> leds) override;

  /// Writes that were disturbed and sent again, since construction.
  [[nodiscard]] std::uint64_t resent() const noexcept { return resent_; }

 private:
  struct Pulse {
    bool one = false;
    std::int64_t high = 0;
    std::int64_t low = 0;
  };
  /// Clocks once; false when the line refused (error_). `quiet` keeps the line low.
  bool clock_out(std::span<const Rgb> leds, bool quiet) noexcept;
  void clock_bit(bool one, bool quiet) noexcept;
  void drive(bool high) noexcept;
  [[nodiscard]] bool undisturbed() const noexcept;
  [[nodiscard]] std::string figures() const;

  std::unique_ptr<gpiod::OutputLine> line_;
  std::string name_;
  int retries_;
  base::Clock& clock_;
  PulseWindow window_;
  std::vector<Pulse> pulses_;  // of the last clock_out()
  std::int64_t fell_at_ = 0;
  int error_ = 0;
  std::uint64_t resent_ = 0;
  std::string note_;
};

}  // namespace dtact::hal::ws2812
