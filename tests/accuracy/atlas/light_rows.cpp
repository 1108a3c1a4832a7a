#include <cmath>
#include <cstddef>
#include <cstdint>

#include "tests/accuracy/atlas/rows.hpp"
#include "tests/accuracy/atlas/scripts.hpp"

namespace dtact::atlas {
namespace {

void dim(Shot& shot, int /*n*/, double factor) { shot.exposure = factor; }
void kill(Shot& shot, int /*n*/, double count) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) shot.light.leds[i] = {};
}

}  // namespace

std::vector<Row> light_rows() {
  return {
      {"light",
       "brightness_down",
       "LEDs dimmer than at the reference, nothing re-zeroed",
       "of the light",
       {1, 0.995, 0.99, 0.98, 0.96, 0.9, 0.75, 0.5},
       on_ball(dim),
       ""},
      {"light",
       "brightness_up",
       "LEDs brighter, nothing re-zeroed",
       "of the light",
       {1, 1.005, 1.01, 1.02, 1.04, 1.1, 1.25, 1.5},
       on_ball(dim),
       ""},
      {"light",
       "brightness_rezero",
       "LEDs dimmer or brighter, then re-zeroed",
       "of the light",
       {1, 1.25, 1.5, 0.75, 0.5, 0.25},
       on_ball(dim, true),
       ""},
      {"light",
       "dead_leds",
       "LEDs dead since the reference",
       "LEDs",
       {0, 1, 2, 3, 4},
       on_ball(kill),
       ""},
      {"light",
       "dead_leds_rezero",
       "LEDs dead, then re-zeroed",
       "LEDs",
       {0, 1, 2, 3, 4},
       on_ball(kill, true),
       ""},
      {"light",
       "colour",
       "LEDs turn warmer: blue lost, and half as much green",
       "share of blue lost",
       {0, 0.01, 0.02, 0.05, 0.1, 0.3},
       on_ball([](Shot& shot, int, double lost) {
         for (auto& led : shot.light.leds) {
           led.b = static_cast<std::uint8_t>(std::lround(255 * (1 - lost)));
           led.g = static_cast<std::uint8_t>(std::lround(255 * (1 - lost / 2)));
         }
       }),
       ""},
      {"light",
       "exposure_drift",
       "exposure or gain drifts within a second",
       "share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2},
       on_ball([](Shot& shot, int n, double drift) {
         shot.exposure = 1 + drift * (n - kReady) / (kFrames - kReady);
       }),
       ""},
      {"light",
       "saturation",
       "overexposed, then re-zeroed",
       "of the light",
       {1, 1.2, 1.4, 1.5, 1.6, 1.8, 2.2},
       on_ball(dim, true),
       ""},
      {"light",
       "near_dark",
       "hardly any light, then re-zeroed",
       "of the light",
       {1, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02},
       on_ball(dim, true),
       ""},
      {"light",
       "banding",
       "PWM bands: a rolling shutter against 400 Hz",
       "amplitude, share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1},
       on_ball([](Shot& shot, int, double band) { shot.band = band; }),
       ""},
      {"light",
       "banding_fast",
       "PWM bands: against 2 kHz",
       "amplitude, share of the light",
       {0, 0.005, 0.01, 0.02, 0.05, 0.1},
       on_ball([](Shot& shot, int, double band) {
         shot.band = band;
         shot.band_rows = 18;
       }),
       ""},
      {"light",
       "leak",
       "ambient light leaks in at one edge",
       "grey levels at the edge",
       {0, 1, 2, 5, 10, 20, 40},
       on_ball([](Shot& shot, int, double leak) { shot.leak = leak; }),
       ""},
  };
}

}  // namespace dtact::atlas
