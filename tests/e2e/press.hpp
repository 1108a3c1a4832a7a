#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/program.hpp"

namespace dtact::e2e {

/// Of the ball of Press.
inline constexpr double kRadiusMm = 4;

/// Press, as a scene.
inline constexpr const char* kScene = R"([loop]
from_s = 2.0
to_s = 14.0

[[press]]
object = "ball"
radius_mm = 4.0
keys = [
  { t = 3.0, x = 0.5, y = -0.5, depth = -0.3 },
  { t = 4.0, depth = 1.0 },
  { t = 8.0 },
  { t = 10.0, x = 1.5 },
  { t = 12.0 },
  { t = 13.0, depth = -0.3 },
]
)";

/// A ball goes in over a second, is held for four, and then slides by a millimetre, again and
/// again.
struct Press {
  /// `surface`: lines of a scene before the rest.
  explicit Press(const TempFolder& folder, const std::string& surface = "")
      : file(folder.path() / "ball.toml") {
    base::write_file_atomically(file, surface + kScene);
    scene = hal::sim::load_scene(file);
  }
  /// The ball's middle at a frame, millimetres.
  [[nodiscard]] std::array<double, 3> middle(std::uint64_t sequence) const {
    const double t = scene.time_s(sequence);
    const auto& keys = scene.presses.at(0).keys;
    const auto next =
        std::find_if(keys.begin(), keys.end(), [t](const auto& key) { return key.time_s > t; });
    const auto& a = next == keys.begin() ? keys.front() : *(next - 1);
    const auto& b = next == keys.end() ? a : *next;
    const double part = b.time_s > a.time_s ? (t - a.time_s) / (b.time_s - a.time_s) : 0;
    return {a.x_mm + part * (b.x_mm - a.x_mm), a.y_mm + part * (b.y_mm - a.y_mm),
            kRadiusMm - a.depth_mm - part * (b.depth_mm - a.depth_mm)};
  }

  std::filesystem::path file;
  hal::sim::Scene scene;
};

}  // namespace dtact::e2e
