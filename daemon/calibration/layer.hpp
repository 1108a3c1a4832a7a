#pragma once

#include <array>

namespace dtact::calibration {

/// The layer as it was fitted to presses of a ball, with standard errors: for people, and for a
/// simulator of this sensor. Depth is made without it.
struct Layer {
  /// A number and its standard error.
  struct Estimate {
    double value = 0;
    double error = 0;
    bool operator==(const Estimate&) const = default;
  };
  Estimate thickness_mm;
  Estimate narrow_mm;  ///< Scattering, as in the model's; here with its errors.
  Estimate wide_mm;
  Estimate narrow_weight;
  /// Where the response's slope is given, indentation / thickness, ascending; between them it is a
  /// straight line, beyond them constant. Share of the local light for each thickness indented.
  std::array<double, 5> indentation = {};
  std::array<Estimate, 5> slope = {};
  double bulge_factor = 1;     ///< On the slopes below zero: a kink there.
  double residual_levels = 0;  ///< Root mean square of what the fit leaves, grey levels.
  bool operator==(const Layer&) const = default;
};

}  // namespace dtact::calibration
