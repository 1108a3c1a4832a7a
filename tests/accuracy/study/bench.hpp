#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "hal/files/png.hpp"
#include "hal/sim/objects.hpp"
#include "hal/sim/truth.hpp"

namespace dtact::study {

/// Scale of the study's images at the median unit: 89 pixels per millimetre.
inline constexpr double kMmPerPx = 1 / 89.0;
inline constexpr int kWidth = 705;  // the study looks at 700 × 700 pixels about two pillars
inline constexpr int kHeight = 705;

/// How much darker a frame is than the reference: whole grey levels, where it is brighter
/// 0, as the study's programs take it.
struct Darkening {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::vector<std::uint8_t> levels;  ///< Row-major.
};

/// The same object rotated about the y axis by `degrees`, its right side deeper.
[[nodiscard]] hal::sim::Object askew(const hal::sim::Object& object, double degrees);
/// How much deeper than its middle the lowest point of that object is. The middle's depth is
/// what a zero from a line through forces finds, as long as all of it is in contact.
[[nodiscard]] double lowest_of_askew(const hal::sim::Object& object, double degrees);

/// One object pressed into a gel at the image's centre, to one depth after another. `sensor`:
/// what the gel is; the camera is the study's.
struct Ladder {
  hal::sim::Object object;
  std::vector<double> depths_mm;  ///< Ascending.
  double deeper_mm = 0;           ///< It is pressed deeper than depths_mm says by as much.
  /// All of it is in contact at any depth, so that the gel answers in proportion and one depth is
  /// solved: an upright flat face.
  bool proportional = false;
};
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> press(const hal::sim::Scene& sensor,
                                                           const Ladder& ladder);

/// What the camera shows at each depth: one frame against the mean of four without contact. Optics
/// and light are `sensor`'s. `shrink`: this many pixels in a row and in a column are averaged into
/// one first, as the study did to see what resolution it takes.
[[nodiscard]] std::vector<Darkening> photograph(const std::shared_ptr<const hal::sim::Truth>& truth,
                                                const hal::sim::Scene& sensor,
                                                std::span<const double> depths_mm, int shrink = 1);

}  // namespace dtact::study
