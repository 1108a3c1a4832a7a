#pragma once

#include <array>

#include "hal/light_ring.hpp"

namespace dtact::hal::ws2812 {

// An LED's current, from the WS2812B's nominal figures: 1 mA asleep, 60 mA at full white. Each
// channel takes a third of the difference, linear in the channel's value (the LEDs are pulse-width
// modulated at constant current).
inline constexpr double kIdleMilliamps = 1;
inline constexpr double kFullMilliamps = 60;

struct DimmingSettings {
  /// Exponent of the brightness: light = colour × (brightness / 255)^gamma. 1: the light is
  /// proportional to the command. 2.2: equal steps look equal to the eye.
  double gamma = 1;
  /// What the whole ring may draw, milliamperes.
  double budget_ma = 500;
};

/// What goes to the wire.
struct DimmedLight {
  std::array<Rgb, kLedCount> leds{};
  double milliamps = 0;  ///< Computed draw of `leds`.
  double scale = 1;      ///< What the budget left of the light; 1 = all of it.
};

/// Computed draw of a ring that shows `leds`, milliamperes.
[[nodiscard]] double current_ma(const std::array<Rgb, kLedCount>& leds);

/// Brightness and gamma first, then the budget. If the ring would draw more, all channels are
/// scaled by one factor, so that colours keep their hue, and rounded down, so that the budget
/// holds. A channel that is on stays on (at least 1) unless the budget forbids. Throws
/// std::invalid_argument for a gamma outside 0.2 … 5 or a budget below the sleeping ring's draw.
[[nodiscard]] DimmedLight dim(const Light& light, const DimmingSettings& settings);

}  // namespace dtact::hal::ws2812
