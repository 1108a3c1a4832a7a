#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/accuracy/table/trial.hpp"

namespace dtact::thickness {

/// Differences of a sensor from the built-in one.
struct Specimen {
  double thickness_mm = 2.0;
  double taper_x = 0;             ///< Taper of the thickness, per mm.
  std::size_t configuration = 0;  ///< Light: index into table::configurations().
};

/// The LUT from thirty presses of a 4 mm ball and that from one, judged on twenty presses of a
/// 5 mm ball and on a flat disc of 10 mm radius pressed 0.25 mm deep, against the simulator's
/// indentation in contact. Presses are those of the table, at most 0.85 of the gel deep.
struct SeveralPresses {
  Specimen specimen;
  std::uint64_t seed = 0;
  /// The chosen gain; "refused" where the presses show no LUT (too light for a thick gel), and
  /// then nothing else is measured.
  std::string gain;
  double several_mm = 0;  ///< Mean absolute error under the 5 mm ball.
  double one_mm = 0;
  double flat_several_mm = 0;
  double flat_one_mm = 0;
  /// True error over the LUT's uncertainty at half depth, for each press of the 5 mm ball.
  std::vector<double> ratios;
};

[[nodiscard]] SeveralPresses measure_several(const Specimen& specimen, std::uint64_t seed,
                                             const table::Protocol& protocol = {});

/// One line a specimen: means over the seeds, the median of all ratios.
[[nodiscard]] std::string to_markdown(const std::vector<SeveralPresses>& results);

}  // namespace dtact::thickness
