#pragma once

#include <cstddef>
#include <string>

#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// A sensor of 160 × 120 pixels over 32 × 24 mm that is solved in milliseconds.
inline const std::string kSmallSensor = R"(
[camera]
width = 160
height = 120
fps = 10.0
mm_per_px = 0.2
[gel]
grid_mm = 0.25
)";

/// A ball of radius 4 mm comes down 1 mm between 1 s and 2 s and stays.
inline const std::string kBallPress = R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 1.0 }, { t = 2.0, depth = 1.0 } ]
)";

inline constexpr std::size_t kPixels = 19200;  // 160 · 120

/// Index of a pixel in the sensor's row-major image.
constexpr std::size_t pixel(int x, int y) {
  return static_cast<std::size_t>(y) * 160 + static_cast<std::size_t>(x);
}

inline Scene small_scene(const std::string& rest = kBallPress) {
  return parse_scene(kSmallSensor + rest, "small.toml");
}

}  // namespace dtact::hal::sim
