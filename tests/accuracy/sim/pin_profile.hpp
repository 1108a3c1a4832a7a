#pragma once

#include <filesystem>
#include <vector>

#include "hal/sim/scene.hpp"
#include "tests/accuracy/sim/ball_profile.hpp"

namespace dtact::accuracy {

/// Mean darkening on rings about the middle nine pins of a pressed board, and between them, grey
/// levels: these show the scattering of a gel best.
struct PinProfile {
  static constexpr double kStep_mm = 0.1;
  /// Ring i reaches from i·kStep_mm to (i + 1)·kStep_mm; the pins are 2.5 mm apart.
  std::vector<double> change;
  double between = 0;   ///< Halfway between two neighbours.
  double diagonal = 0;  ///< In the middle of four.
};

/// Profile of the folder's board_reference.png and board.png. The scale is the images': the
/// mean distance of the nine pins. `middle`: a place near the middle pin, pixels.
[[nodiscard]] PinProfile real_pins(const std::filesystem::path& folder, const Centre& middle);

/// Profile of the calibration board pressed this deep into the sensor of `scene`; without noise.
[[nodiscard]] PinProfile simulated_pins(const hal::sim::Scene& scene, double depth_mm);

/// Root mean square of the difference of rings and both places between, when `a` is first moved by
/// `offset`: the drift between a reference image and a press.
[[nodiscard]] double rms_difference(const PinProfile& a, const PinProfile& b, double offset);

}  // namespace dtact::accuracy
