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

/// A simulated sensor on which a calibration is judged.
struct Specimen {
  std::string name;
  hal::sim::Scene scene;
};

/// Gels of 1.5, 2, 2.5 and 3 mm, then four other optics, then one with another law of gel and
/// light, which no fitted gel can have.
[[nodiscard]] std::vector<Specimen> specimens();

/// Result of one specimen and seed. Errors are mean absolute errors against the simulator's
/// indentation in contact with the ball, millimetres, no offset removed.
struct Result {
  std::string refused;  ///< The reason, or empty; then only `free_mm` is measured.
  std::optional<calibration::ModelFit> fit;
  double light_levels = 0;
  double seconds = 0;  ///< Time of the calibration.
  double true_depth_mm = 0;
  double free_mm = std::numeric_limits<double>::quiet_NaN();  ///< Under a 5 mm ball, by the free
                                                              ///< LUT of the same images.
  double model_mm = 0;                                        ///< By the model's LUT.
  double ours_mm = 0;                                         ///< By the default method.
  std::string note;                                           ///< The default method's message.
  /// By the model's LUTs for one and two steps of the filter, as the daemon applies it.
  std::array<double, 2> sharpened_mm = {};
  double bias_mm = 0;    ///< The default method's mean error with its sign.
  double stated_mm = 0;  ///< Its stated uncertainty at the tests' mean depth.
};

/// `presses` 1: the press near the centre; else this many presses anywhere.
[[nodiscard]] Result measure(const Specimen& specimen, std::uint64_t seed, int presses, int tests);

}  // namespace dtact::model_study
