#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "hal/base/clock.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/ws2812/encoder.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// Where the encoded bytes go.
class SpiPort {
 public:
  SpiPort() = default;
  SpiPort(const SpiPort&) = delete;
  SpiPort& operator=(const SpiPort&) = delete;
  virtual ~SpiPort() = default;

  [[nodiscard]] virtual std::string name() const = 0;
  /// The longest transfer, bytes.
  [[nodiscard]] virtual std::size_t max_bytes() const = 0;
  /// Sends the bytes without a pause and waits until they are through. Returns 0 or an errno.
  [[nodiscard]] virtual int transfer(std::span<const std::uint8_t> bytes) noexcept = 0;
};

/// /dev/spidevB.C in mode 0, 8 bits a word.
class Spidev final : public SpiPort {
 public:
  /// Throws std::runtime_error naming the device and the fix (absent, no permission, refuses
  /// mode or speed).
  Spidev(const std::string& device, std::uint32_t hz);

  [[nodiscard]] std::string name() const override { return device_; }
  [[nodiscard]] std::size_t max_bytes() const override { return max_bytes_; }
  [[nodiscard]] int transfer(std::span<const std::uint8_t> bytes) noexcept override;

 private:
  std::string device_;
  std::uint32_t hz_;
  std::size_t max_bytes_;
  base::UniqueFd fd_;
};

/// What an errno of a spidev call means for its user: the fix as a sentence's end.
[[nodiscard]] std::string spi_fix(int error);

/// The rate at which a controller really clocks bits out, by timing all-zero transfers (LEDs read
/// them as a latch). Asking the driver is no use: it returns what was asked for. Two lengths are
/// timed and their difference taken, which cancels what a call costs besides the wire; the least of
/// several, since interruptions only lengthen.
struct MeasuredRate {
  double hz = 0;           ///< 0: the transfers took no time, so no wire was driven.
  int error = 0;           ///< errno of a transfer that failed.
  double overhead_ns = 0;  ///< What a transfer takes besides the wire's time, typically.
};
[[nodiscard]] MeasuredRate measure_rate(SpiPort& port, base::Clock& clock);

/// Empty when a format asked for still makes pulses inside the window at the measured rate; else
/// the sentence with both rates and the cure.
[[nodiscard]] std::string why_rate_refused(const SpiFormat& asked, double measured_hz);

/// WS2812B on an SPI controller's data line (MOSI).
///
/// The controller's clock may change at run time, and LEDs then show anything without an error
/// (jgarff/rpi_ws281x#381, #401: a Raspberry Pi 4 at idle). So the writing thread times each
/// transfer and subtracts the cost besides the wire. The resulting rate
/// must lie in the window. A transfer outside is repeated, which restores the LEDs if the clock was
/// off for a moment, and else costs a millisecond. An interruption only lengthens, so a
/// short transfer is always a fast clock; a long one may be a busy machine, and so may three in a
/// row. Then the rate is measured as at the start, which interruptions hardly affect. That alone
/// decides: a clock outside the window is an error, and the wire is lost() until it is right again.
class SpiWire final : public Wire {
 public:
  /// Needs a format that why_refused() accepts. Without `check_rate` nothing is measured or timed.
  SpiWire(std::unique_ptr<SpiPort> port, const SpiFormat& format, bool check_rate,
          base::Clock& clock = base::system_clock());

  [[nodiscard]] std::string prepare(int leds) override;
  [[nodiscard]] std::string note() const override;
  [[nodiscard]] std::string send(std::span<const Rgb> leds) override;
  [[nodiscard]] bool lost() const override { return lost_; }

 private:
  struct Timed {
    int error = 0;
    double ns = 0;
  };
  [[nodiscard]] std::string check_rate();
  [[nodiscard]] Timed transfer(std::span<const std::uint8_t> bytes) noexcept;
  [[nodiscard]] std::string gave_up(int error);

  std::unique_ptr<SpiPort> port_;
  SpiFormat format_;
  bool check_rate_;
  base::Clock& clock_;
  std::string deviation_;    // note on the rate measured last
  double overhead_ns_ = 0;   // of a transfer, measured with it
  std::uint64_t sent_ = 0;   // transfers of colours
  std::uint64_t again_ = 0;  // of these, sent again because they were off
  std::string last_off_;
  bool lost_ = false;
};

}  // namespace dtact::hal::ws2812
