#pragma once

#include <optional>
#include <vector>

#include "clients/calibrate/fit/list_shape.hpp"

namespace dtact::calibration {

/// What one press of a ball shows inside its sure contact: darkening against sag below the lowest
/// point, sag(r) = R − √(R² − r²), in rings about the contact's centre.
struct SagProfile {
  struct Ring {
    double level = 0;   ///< Mean darkening, grey levels.
    double sag_mm = 0;  ///< How much shallower than the lowest point.
    double weight = 0;  ///< Pixels.
  };
  std::vector<Ring> rings;         ///< From the middle outwards.
  std::optional<double> depth_mm;  ///< Of the lowest point, when somebody measured it.
  /// What the gain is linear in, at this press's place (gain_terms()); empty: no gain is fitted.
  std::vector<double> place = {};
};

/// One list for all presses, and how deep each of them was.
struct ChainFit {
  std::vector<Knot> knots;       ///< Rising; the first at a darkening above zero.
  std::vector<double> depth_mm;  ///< Of each press's lowest point.
  std::vector<double> gain;      ///< As recon::SpatialGain::polynomial.
  /// Indentations that no press shows between two that are shown (or zero), millimetres.
  struct Gap {
    double from_mm = 0;
    double to_mm = 0;
  };
  std::vector<Gap> gaps;
};

/// The list M, linear between knots two grey levels apart with M(0) = 0, and a depth g for each
/// press, so that M(level) = g − sag holds in the rings of all: one linear least-squares solve. No
/// circle is needed: inside one press only the slope of M is seen, presses of several depths chain
/// from zero upward, and a press of known depth ties the chain to it. M is kept
/// straight by a penalty on its bends, and where nothing is seen it goes on straight. Then M is
/// made to rise.
///
/// With places, darkening counts 1 + gain · place times, and the gain is fitted with the rest, by
/// Gauss and Newton.
///
/// Throws std::invalid_argument when there is no ring.
[[nodiscard]] ChainFit fit_chain(const std::vector<SagProfile>& presses);

/// 1 + gain · place, above zero.
[[nodiscard]] double gain_at(const std::vector<double>& gain, const std::vector<double>& place);

/// A gap below this is bridged by the list's straightness, millimetres.
inline constexpr double kBridgedMm = 0.15;
/// From zero to the shallowest ring the list is a line to the origin: no darkening is no depth.
inline constexpr double kBridgedFromZeroMm = 0.4;

}  // namespace dtact::calibration
