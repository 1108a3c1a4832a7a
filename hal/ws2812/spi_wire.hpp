#pragma once

#include <memory>
#include <span>
#include <string>

#include "hal/base/clock.hpp"
#include "hal/ws2812/encoder.hpp"
#include "hal/ws2812/spi_port.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// The rate at which a controller really clocks bits out, by timing all-zero transfers (LEDs read
/// them as a latch). Asking the driver is no use: it returns what was asked for. Two lengths are
/// timed and their difference taken, which cancels what a call costs besides the wire; the least of
/// several, since interruptions only lengthen.
struct MeasuredRate {
  double hz = 0;  ///< 0: the transfers took no time, so no wire was driven.
  int error = 0;  ///< errno of a transfer that failed.
};
[[nodiscard]] MeasuredRate measure_rate(SpiPort& port, base::Clock& clock);

/// Empty when a format asked for still makes pulses inside the window at the measured rate; else
/// the sentence with both rates and the cure.
[[nodiscard]] std::string why_rate_refused(const SpiFormat& asked, double measured_hz);

/// WS2812B on an SPI controller's data line (MOSI).
class SpiWire final : public Wire {
 public:
  /// Needs a format that why_refused() accepts.
  SpiWire(std::unique_ptr<SpiPort> port, const SpiFormat& format, bool check_rate,
          base::Clock& clock = base::system_clock());

  [[nodiscard]] RingInfo info() const override;
  [[nodiscard]] std::string prepare(int leds) override;
  [[nodiscard]] std::string note() const override { return note_; }
  [[nodiscard]] std::string send(std::span<const Rgb> leds) override;
  [[nodiscard]] bool lost() const override { return lost_; }

 private:
  std::unique_ptr<SpiPort> port_;
  SpiFormat format_;
  bool check_rate_;
  base::Clock& clock_;
  std::string note_;
  bool lost_ = false;
};

}  // namespace dtact::hal::ws2812
