#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "tests/e2e/patience.hpp"
#include "tests/e2e/program.hpp"

namespace dtact::e2e {

/// Radius of the ball of Press.
inline constexpr double kRadiusMm = 4;

/// A ball goes in over a second, is held for four, and then slides by a millimetre, repeatedly.
/// With sanitizers all takes kSlower times as long, so that a search ends while it is held.
struct Press {
  /// `surface`: lines of a scene before the rest.
  explicit Press(const TempFolder& folder, const std::string& surface = "")
      : file(folder.path() / "ball.toml") {
    const auto at = [](double seconds) { return kSlower * seconds; };
    base::write_file_atomically(file, surface + fmt::format(R"([loop]
from_s = {:.1f}
to_s = {:.1f}

[[press]]
object = "ball"
radius_mm = {:.1f}
keys = [
  {{ t = {:.1f}, x = 0.5, y = -0.5, depth = -0.3 }},
  {{ t = {:.1f}, depth = 1.0 }},
  {{ t = {:.1f} }},
  {{ t = {:.1f}, x = 1.5 }},
  {{ t = {:.1f} }},
  {{ t = {:.1f}, depth = -0.3 }},
]
)",
                                                            at(2), at(14), kRadiusMm, at(3), at(4),
                                                            at(8), at(10), at(12), at(13)));
    scene = hal::sim::load_scene(file);
  }
  /// Time of a frame without sanitizers' factor: the ball is pressed in from 3 to 4, held to 8,
  /// slid to 10 and held to 12.
  [[nodiscard]] double time_s(std::uint64_t sequence) const {
    return scene.time_s(sequence) / kSlower;
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
