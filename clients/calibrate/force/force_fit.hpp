#pragma once

#include <string>
#include <vector>

#include "daemon/recon/force.hpp"

namespace dtact::force {

/// A contact and what a scale said of it.
struct Pair {
  std::string name;  ///< For messages: where it is from.
  double volume_mm3 = 0;
  double area_mm2 = 0;
  double newtons = 0;
};

/// Fewer pairs determine three numbers, and how heavily to distrust them, too badly.
inline constexpr int kLeastPairs = 8;

struct Fit {
  recon::ForceModel model;
  double ridge = 0;              ///< The weight that was chosen.
  std::vector<double> left_out;  ///< Of each pair: what the others say of it minus the reading, N.
};

/// Ridge regression of the reading on V, A and V A without a constant, each scaled to a root mean
/// square of 1. Of weights 1e-8 … 1 the one whose mean absolute leave-one-out error is smallest.
/// `threshold_mm`, `sharpen_steps`: of volume and area. Throws std::invalid_argument with a
/// sentence that says what to do when there are fewer than kLeastPairs, one has no contact or no
/// positive reading, the readings do not grow with the volume (Spearman's rank correlation below
/// 0.8), or their ratio is none that silicones have: 0.02 … 5 N per mm³ as the layers of the public
/// study (0.07 … 0.3) with room on both sides; readings in grams are 102 times as large, in
/// kilograms as small.
[[nodiscard]] Fit fit_force(const std::vector<Pair>& pairs, double threshold_mm,
                            int sharpen_steps = 0);

}  // namespace dtact::force
