#include "hal/ws2812/dimming.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dtact::hal::ws2812 {
namespace {

constexpr double kRingIdle = kIdleMilliamps * kLedCount;
constexpr double kPerStep = (kFullMilliamps - kIdleMilliamps) / (3 * 255);

void check(const DimmingSettings& settings) {
  if (!(settings.gamma >= 0.2 && settings.gamma <= 5)) {
    throw std::invalid_argument(
        fmt::format("ring.ws2812.gamma = {}: allowed are 0.2 … 5", settings.gamma));
  }
  if (!(settings.budget_ma >= kRingIdle)) {
    throw std::invalid_argument(
        fmt::format("ring.ws2812.current_budget_ma = {}: {} sleeping LEDs draw {} mA already; set "
                    "what the supply can give",
                    settings.budget_ma, kLedCount, kRingIdle));
  }
}

}  // namespace

double current_ma(const std::array<Rgb, kLedCount>& leds) {
  int steps = 0;
  for (const Rgb& led : leds) steps += led.r + led.g + led.b;
  return kRingIdle + kPerStep * steps;
}

DimmedLight dim(const Light& light, const DimmingSettings& settings) {
  check(settings);
  DimmedLight out;
  const double factor = std::pow(light.brightness / 255.0, settings.gamma);
  const auto shade = [&](std::uint8_t channel) {
    if (channel == 0 || light.brightness == 0) return std::uint8_t{0};
    return static_cast<std::uint8_t>(std::max(1L, std::lround(channel * factor)));
  };
  for (std::size_t i = 0; i < out.leds.size(); ++i) {
    const Rgb& led = light.leds[i];
    out.leds[i] = {shade(led.r), shade(led.g), shade(led.b)};
  }

  out.milliamps = current_ma(out.leds);
  if (out.milliamps > settings.budget_ma + 1e-6) {
    out.scale = (settings.budget_ma - kRingIdle) / (out.milliamps - kRingIdle);
    const auto cut = [&](std::uint8_t channel) {
      // The epsilon keeps an exact product from falling one step through rounding.
      return static_cast<std::uint8_t>(std::floor(channel * out.scale + 1e-9));
    };
    for (Rgb& led : out.leds) led = {cut(led.r), cut(led.g), cut(led.b)};
    out.milliamps = current_ma(out.leds);
  }
  return out;
}

}  // namespace dtact::hal::ws2812
