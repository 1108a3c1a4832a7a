#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/recon/force.hpp"

namespace dtact::force {

/// A contact and the scale's reading.
struct Pair {
  std::string name;  ///< Source, for messages.
  recon::CellMap contact;
  double newtons = 0;
};

/// Three numbers and their error need at least this number of pairs.
inline constexpr int kMinPairs = 6;

struct Fit {
  recon::ForceModel model;
  std::vector<double> left_out;  ///< For each pair: prediction by the others − reading, N.
};

/// Fits Young's modulus, the depth's zero and, unless it is known, the gel's thickness to the
/// readings by least squares. An error of 2 % of the reading counts as much as one of 5 mN; zeros
/// around 0 ± 0.03 mm and thicknesses around 2 mm ± 35 % are preferred.
///
/// Throws std::invalid_argument with the fix when there are fewer than kMinPairs, contacts are of
/// different map sizes, one is missing or cut off or has no positive reading, left-out pairs
/// are missed by more than a quarter, or the modulus is outside the range of silicones: 0.02 … 2
/// MPa (the public study's gels: 0.04 … 0.27). Readings in grams give 102 times as much, in
/// kilograms a tenth.
[[nodiscard]] Fit fit_force(const std::vector<Pair>& pairs,
                            std::optional<double> thickness_mm = std::nullopt);

}  // namespace dtact::force
