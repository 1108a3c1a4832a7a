#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
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

/// How a ring is got at. Both functions throw std::runtime_error with a sentence that names device
/// and remedy, and are called again when the ring is away.
struct RingParts {
  RingInfo info;
  std::function<std::unique_ptr<Wire>()> open_wire;
  /// Switches the LEDs' supply on; empty = they always have it. Once on, it stays on.
  std::function<std::unique_ptr<gpiod::PowerSwitch>()> switch_on;
};

/// A ring of WS2812B. One thread of its own does every write: what show() asks for, which waits
/// for the outcome, and the re-sends, by which an LED that caught a glitch finds back to its
/// colour. What is sent again is the last light that show() brought to the LEDs; when none has got
/// there yet, the one asked for last. A re-send that fails shows in report().
///
/// A ring that is absent, busy, forbidden or refused by its own wire is away: show() says so at
/// once, and the ring is looked for, first after a quarter of a second, then ever more rarely down
/// to every two seconds. On destruction it goes dark, then loses its power, unless it is to be left
/// on.
class Ring final : public LightRing {
 public:
  /// Waits until the ring has been looked for once. Throws std::invalid_argument for settings that
  /// make no sense.
  Ring(RingParts parts, const Ws2812Config& config);
  ~Ring() override;

  [[nodiscard]] RingInfo info() const override { return parts_.info; }
  [[nodiscard]] ShowResult show(const Light& light) override;
  [[nodiscard]] RingReport report() const override;

 private:
  using Leds = std::array<Rgb, kLedCount>;

  using Time = std::chrono::steady_clock::time_point;

  void run();
  // The thread's steps. Each is called and returns with the lock held.
  void look_for_ring(std::unique_lock<std::mutex>& lock);
  void wait(std::unique_lock<std::mutex>& lock);
  void write(std::unique_lock<std::mutex>& lock, const Leds& leds);
  void answer(std::uint64_t ticket, const std::string& error);
  void be_away(const std::string& why);
  [[nodiscard]] Leds in_chain_order(const Leds& leds) const;

  RingParts parts_;
  Ws2812Config config_;
  DimmingSettings dimming_;
  // The thread's alone once it runs:
  std::unique_ptr<gpiod::PowerSwitch> power_;
  std::unique_ptr<Wire> wire_;  // null: the ring is away
  std::chrono::milliseconds pause_{};
  Time next_look_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;     // for the thread: a new light, or stop
  std::condition_variable written_;  // for callers: a write is through
  // Guarded by mutex_:
  Leds wanted_{};              // in chain order
  std::optional<Leds> shown_;  // the last that got there
  std::uint64_t asked_ = 0, done_ = 0;
  std::string outcome_;  // of the last light that was asked for
  bool looked_ = false, stop_ = false;
  RingReport report_;

  base::RtThread thread_;  // last: it uses all of the above
};

/// The rings that the registry offers. A device that is not there is looked for; what throws is a
/// configuration that can never work: std::runtime_error or std::invalid_argument naming the key.
[[nodiscard]] std::unique_ptr<LightRing> open_spi_ring(const Ws2812Config& config);
[[nodiscard]] std::unique_ptr<LightRing> open_pio_ring(const Ws2812Config& config);

}  // namespace dtact::hal::ws2812
