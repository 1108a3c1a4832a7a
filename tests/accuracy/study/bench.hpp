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
inline constexpr int kWidth = 705;  // the study evaluates 700 × 700 pixels about two pillars
inline constexpr int kHeight = 705;

/// Darkening of a frame from the reference in whole grey levels, 0 where it is brighter, like in
/// the study's programs.
struct Darkening {
  int width = 0;
  int height = 0;
  double mm_per_px = 0;
  std::vector<std::uint8_t> levels;  ///< Row-major.
};

/// The same object rotated about the y axis by `degrees`, its right side deeper.
[[nodiscard]] hal::sim::Object askew(const hal::sim::Object& object, double degrees);
/// Depth of that object's lowest point below its middle. A zero from a line through forces finds
/// the middle's depth, as long as all of it is in contact.
[[nodiscard]] double lowest_of_askew(const hal::sim::Object& object, double degrees);

/// One object pressed into a gel at the image's centre, to one depth after another. `sensor` has
/// the gel; the camera is the study's.
struct Ladder {
  hal::sim::Object object;
  std::vector<double> depths_mm;  ///< Ascending.
  double deeper_mm = 0;           ///< The object is pressed deeper than depths_mm by this.
  /// All of it is in contact at any depth, so that the gel responds in proportion and one depth is
  /// solved: an upright flat face.
  bool proportional = false;
};
[[nodiscard]] std::shared_ptr<const hal::sim::Truth> press(const hal::sim::Scene& sensor,
                                                           const Ladder& ladder);

/// The camera's picture at each depth: one frame against the mean of four without contact. Optics
/// and light are `sensor`'s. `shrink`: this many pixels in a row and in a column are averaged into
/// one first, as the study did to find the necessary resolution.
[[nodiscard]] std::vector<Darkening> photograph(const std::shared_ptr<const hal::sim::Truth>& truth,
                                                const hal::sim::Scene& sensor,
                                                std::span<const double> depths_mm, int shrink = 1);

}  // namespace dtact::study
