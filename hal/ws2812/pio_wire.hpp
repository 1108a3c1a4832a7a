#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>

#include "hal/base/clock.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// WS2812B on a GPIO line that the kernel clocks through a Raspberry Pi 5's PIO: the character
/// device of the driver ws2812-pio-rp1 (raspberrypi/linux#6551, dtoverlay=ws2812-pio). It takes
/// four bytes a LED (red, green, blue, white) at offset 0 and sends them after write() has
/// returned, so a failure on the way to the LEDs is not reported. A single byte at offset 0
/// is a brightness that selects the driver's own gamma table; 0 passes colours
/// unchanged.
///
/// The device is opened for each write, since removing the driver frees what an open file still
/// points to (ws2812_pio_rp1_remove()). A file that is not newly opened has left offset 0, to which
/// the driver cannot seek.
class PioWire final : public Wire {
 public:
  explicit PioWire(std::string device, base::Clock& clock = base::system_clock());

  /// Sets the brightness to 0 and sees whether the driver takes as many LEDs and no more, which
  /// leaves them dark.
  [[nodiscard]] std::string prepare(int leds) override;
  [[nodiscard]] std::string note() const override { return {}; }
  /// Prepares anew when the device has been made anew since.
  [[nodiscard]] std::string send(std::span<const Rgb> leds) override;
  [[nodiscard]] bool lost() const override { return lost_; }

 private:
  /// Returns 0 or an errno; EFBIG: the driver has fewer LEDs.
  [[nodiscard]] int write(std::span<const std::uint8_t> bytes) noexcept;
  [[nodiscard]] std::string failed(int error) const;
  void wait(std::int64_t ns) noexcept { clock_.sleep_until(clock_.monotonic_ns() + ns); }

  std::string device_;
  base::Clock& clock_;
  ino_t node_ = 0;  // of the last write: another number is another device
  bool lost_ = false;
};

}  // namespace dtact::hal::ws2812
