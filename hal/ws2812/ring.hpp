#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "hal/base/rt_thread.hpp"
#include "hal/config.hpp"
#include "hal/gpiod/power_switch.hpp"
#include "hal/light_ring.hpp"
#include "hal/ws2812/dimming.hpp"
#include "hal/ws2812/wire.hpp"

namespace dtact::hal::ws2812 {

/// A ring of WS2812B. One thread of its own does every write: what show() asks for, which waits
/// for the outcome, and the re-sends, by which an LED that caught a glitch finds back to its
/// colour. What is sent again is the last light that show() brought to the LEDs; when none has got
/// there yet, the one asked for last. A re-send that fails shows in report(). On destruction the
/// ring goes dark, then loses its power, unless it is to be left on.
class Ring final : public LightRing {
 public:
  /// `power` may be null; else it is on already. Waits until the wire has measured itself. Throws
  /// std::runtime_error with the wire's sentence when it refuses, std::invalid_argument for
  /// settings that make no sense. `priority`: SCHED_FIFO priority of the thread, 0 = normal.
  Ring(std::unique_ptr<Wire> wire, std::unique_ptr<gpiod::PowerSwitch> power,
       const Ws2812Config& config, int priority);
  ~Ring() override;

  [[nodiscard]] RingInfo info() const override { return info_; }
  [[nodiscard]] ShowResult show(const Light& light) override;
  [[nodiscard]] RingReport report() const override;

 private:
  using Leds = std::array<Rgb, kLedCount>;

  void run();
  [[nodiscard]] Leds in_chain_order(const Leds& leds) const;

  std::unique_ptr<gpiod::PowerSwitch> power_;
  std::unique_ptr<Wire> wire_;  // the thread's alone once it runs
  Ws2812Config config_;
  DimmingSettings dimming_;
  RingInfo info_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;     // for the thread: a new light, or stop
  std::condition_variable written_;  // for callers: a write is through
  // Guarded by mutex_:
  Leds wanted_{};              // in chain order
  std::optional<Leds> shown_;  // the last that got there
  std::uint64_t asked_ = 0, done_ = 0;
  std::string outcome_;  // of the last light that was asked for
  bool prepared_ = false, stop_ = false;
  RingReport report_;

  base::RtThread thread_;  // last: it uses all of the above
};

/// The rings that the registry offers. Throw std::runtime_error naming key, device and remedy.
[[nodiscard]] std::unique_ptr<LightRing> open_spi_ring(const Ws2812Config& config);
[[nodiscard]] std::unique_ptr<LightRing> open_pio_ring(const Ws2812Config& config);

}  // namespace dtact::hal::ws2812
