#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/model/model_build.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::model_study {

/// A simulated sensor that a calibration is judged on.
struct Specimen {
  std::string name;
  hal::sim::Scene scene;
};

/// Gels of 1.5, 2, 2.5 and 3 mm, then four other optics, then one of another law of gel and
/// light, which no gel that is fitted can be.
[[nodiscard]] std::vector<Specimen> specimens();

/// Result of one specimen and seed. Errors are mean absolute errors against the simulator's
/// indentation in contact with the ball, millimetres, no offset removed.
struct Result {
  std::string refused;  ///< Why; then only `free_mm` is measured.
  std::optional<calibration::ModelFit> fit;
  double light_levels = 0;
  double seconds = 0;  ///< Time of the calibration.
  double true_depth_mm = 0;
  double free_mm = std::numeric_limits<double>::quiet_NaN();  ///< Under a 5 mm ball, by the free
                                                              ///< LUT of the same images.
  double model_mm = 0;                                        ///< By the model's.
  double ours_mm = 0;                                         ///< By the default method.
  std::string note;                                           ///< What that says of itself.
  /// By its LUTs for one and two steps of the filter, as the daemon applies it.
  std::array<double, 2> sharpened_mm = {};
  double bias_mm = 0;    ///< Its mean error with its sign.
  double stated_mm = 0;  ///< What it says of itself at the tests' mean depth.
};

/// `presses` 1: the press near the centre; else this many presses anywhere.
[[nodiscard]] Result measure(const Specimen& specimen, std::uint64_t seed, int presses, int tests);

}  // namespace dtact::model_study
