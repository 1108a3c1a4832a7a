#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/sim/scene.hpp"
#include "tests/accuracy/study/reading.hpp"

namespace dtact::study {

inline constexpr std::array<double, 6> kDepths_mm = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
/// The zero of a ball that the study found from forces is this far below the surface (median of
/// 17 units, ± 0.029): its balls were pressed deeper than it states by this.
inline constexpr double kBallZero_mm = 0.155;
/// Threshold of the study's radii and means, grey levels.
inline constexpr int kThreshold = 5;

/// A simulated sensor that goes through the study.
struct Specimen {
  std::string law;  ///< Law of gel and light.
  hal::sim::Scene sensor;
};

/// The built-in sensor on gels of that thickness: with light and widths scaled with it
/// (thickness::sensor_of), and with the widths it has on 2 mm; one that scatters like sensor_c; and
/// the other law.
[[nodiscard]] std::vector<Specimen> specimens(double thickness_mm);

/// One depth of the ball, the flat cylinder and the cube, all 4 mm wide.
struct Rung {
  double depth_mm = 0;  ///< The ball is kBallZero_mm deeper.
  FlatReading cylinder;
  FlatReading cylinder_uncorrected;  ///< By a LUT without correction of the ball's zero.
  FlatReading cube;
  Patch ball_patch;
  Patch cylinder_patch;
};

/// Two flat pillars of 1 mm diameter at one depth.
struct PillarPress {
  double spacing_mm = 0;
  double tilt_deg = 0;
  double depth_mm = 0;
  Pillars seen;                     ///< At the camera's resolution.
  std::optional<Pillars> averaged;  ///< On 3 × 3 pixels averaged, with less noise; upright only.
};

/// Presses to measure; tests use fewer.
struct Protocol {
  bool shapes = true;
  std::vector<double> spacings_mm = {1.10, 1.25, 1.50, 1.75, 2.00, 2.50};
  std::vector<double> depths_mm = {0.1, 0.2, 0.3, 0.6};
  std::vector<double> tilts_deg = {1, 2};  ///< Beside upright ones.
  std::vector<double> leaning_spacings_mm = {1.25, 1.50, 1.75, 2.00};
  std::vector<double> leaning_depths_mm = {0.1, 0.2, 0.3};
};

/// Results of one specimen in the study.
struct Result {
  std::string law;
  double thickness_mm = 0;
  double mm_per_level = 0;  ///< Depth of the deepest ball over its darkest grey level.
  std::vector<Rung> resolutions;
  std::vector<PillarPress> pillars;

  /// The spacings of 1.25, 1.5, 1.75 and 2 mm that are resolved at 0.1, 0.2 or 0.3 mm.
  [[nodiscard]] int resolved_of_four(double tilt_deg) const;
};

/// Measures specimens; those on the same gel share its presses. Results come in their order.
[[nodiscard]] std::vector<Result> measure(const std::vector<Specimen>& specimens,
                                          const Protocol& protocol = {});

[[nodiscard]] std::string to_csv(const std::vector<Result>& results);

}  // namespace dtact::study
