#pragma once

#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "hal/config.hpp"
#include "hal/gpiod/power_switch.hpp"
#include "hal/light_ring.hpp"
#include "hal/ws2812/dimming.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// How a ring is got at. Both functions throw std::runtime_error with a sentence that names device
/// and fix, and are called again when the ring is away.
struct RingParts {
  RingInfo info;
  std::function<std::unique_ptr<Wire>()> open_wire;
  /// Switches the LEDs' supply on; empty = they always have it. Once on, it stays on.
  std::function<std::unique_ptr<gpiod::PowerSwitch>()> switch_on;
};

/// A ring of WS2812B. attend() re-sends the light every `resend_ms`, which restores an LED after
/// a glitch.
///
/// A ring that is absent, busy, forbidden or refused by its own wire is away. show() reports it at
/// once, and the ring is searched for, first after a quarter of a second, then less and less often,
/// at least every two seconds. On destruction it turns dark and then loses its power, unless it
/// stays on by configuration.
class Ring final : public LightRing {
 public:
  /// Looks for the ring once. Throws std::invalid_argument for settings that make no sense.
  Ring(RingParts parts, const Ws2812Config& config);
  ~Ring() override;

  [[nodiscard]] RingInfo info() const override { return parts_.info; }
  [[nodiscard]] ShowResult show(const Light& light) override;
  [[nodiscard]] RingReport attend(const Light& light) override;

 private:
  using Leds = std::array<Rgb, kLedCount>;
  using Time = std::chrono::steady_clock::time_point;

  void look_for_ring();
  /// Writes in chain order. Returns what failed; empty when nothing did.
  std::string write(const Leds& leds);
  void be_away(const std::string& why);
  [[nodiscard]] Leds in_chain_order(const Leds& leds) const;

  RingParts parts_;
  Ws2812Config config_;
  DimmingSettings dimming_;
  std::unique_ptr<gpiod::PowerSwitch> power_;
  std::unique_ptr<Wire> wire_;  // null: the ring is away
  std::chrono::milliseconds pause_{};
  Time next_look_;
  Time next_send_ = Time::max();  // before the first show() there is nothing to repeat
  RingReport report_;
};

/// The rings that the registry offers. A device that is not there is looked for; what throws is a
/// configuration that can never work: std::runtime_error or std::invalid_argument naming the key.
/// Throws std::runtime_error with the fix where the LEDs cannot read bits of this rate and number.
void check_spi(const Ws2812Config& config);
[[nodiscard]] std::unique_ptr<LightRing> open_spi_ring(const Ws2812Config& config);
[[nodiscard]] std::unique_ptr<LightRing> open_pio_ring(const Ws2812Config& config);

}  // namespace dtact::hal::ws2812
