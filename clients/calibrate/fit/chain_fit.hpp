#pragma once

#include <optional>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"

namespace dtact::calibration {

/// A press of a ball inside its sure contact: darkening against sag below the lowest
/// point, sag(r) = R − √(R² − r²), in rings about the contact's centre.
struct SagProfile {
  struct Ring {
    double level = 0;   ///< Mean darkening, grey levels.
    double sag_mm = 0;  ///< Depth below that of the lowest point.
    double weight = 0;  ///< Pixels.
  };
  std::vector<Ring> rings;         ///< From the middle outwards.
  std::optional<double> depth_mm;  ///< Measured depth of the lowest point, if any.
  /// Terms of the gain at this press's position (gain_terms()); empty: no gain is fitted.
  std::vector<double> place = {};
};

/// One LUT for all presses, and the depth of each press.
struct ChainFit {
  std::vector<Knot> knots;       ///< Rising; the first at a darkening above zero.
  std::vector<double> depth_mm;  ///< Depth of each press's lowest point.
  std::vector<double> gain;      ///< See recon::FlatFieldGain::polynomial.
  /// Indentations between two shown ones (or zero) that no press shows, millimetres.
  struct Gap {
    double from_mm = 0;
    double to_mm = 0;
  };
  std::vector<Gap> gaps;
};

/// Fits the LUT M, linear between knots two grey levels apart with M(0) = 0, and a depth g for each
/// press, so that M(level) = g − sag holds in all rings: one linear least-squares solve. No
/// circle is needed: one press determines only the slope of M, presses of several depths chain
/// from zero upward, and a press of known depth fixes the chain. A penalty on its bends keeps M
/// straight, also where no ring is. Then M is
/// made to rise.
///
/// With gain terms, darkening counts 1 + gain · terms times, and the gain is fitted with the rest,
/// by Gauss and Newton.
///
/// Throws std::invalid_argument without rings.
[[nodiscard]] ChainFit fit_chain(const std::vector<SagProfile>& presses);

/// 1 + gain · place, above zero.
[[nodiscard]] double gain_at(const std::vector<double>& gain, const std::vector<double>& place);

/// A gap below this is bridged by the LUT's straightness, millimetres.
inline constexpr double kBridgedMm = 0.15;
/// From zero to the shallowest ring the LUT is a line to the origin: no darkening is no depth.
inline constexpr double kBridgedFromZeroMm = 0.4;

/// The gel's contact with a ball is narrower than the circle in which the ball cuts the undeformed
/// surface: 3.04 mm against 3.12 for a 4 mm ball 1.5 mm deep (solved for 2 to 2.5 mm thickness).
inline constexpr double kContactOfCut = 0.97;

/// A press as input of the chain: rings of one pixel from the middle to the visible edge of the
/// contact.
struct PressRings {
  SagProfile all;
  double seen_mm = 0;  ///< Contact radius in the image.
  double ball_radius_mm = 0;
};

/// Terms of a gain with `terms` factors (0, 2 or 5) at a press: x, y, x², xy, y² of the
/// contact's centre, millimetres from the map's.
[[nodiscard]] std::vector<double> gain_terms(const SettledPress& press, int terms);

/// `depth_mm` of the lowest point, where measured; `terms` of the gain to be fitted.
[[nodiscard]] PressRings rings_of(const SettledPress& press, std::optional<double> depth_mm,
                                  int terms);

/// fit_chain() on the sure part of each contact (three fifths of its radius; light scattered from
/// the ring disturbs the rest). Radius from depth and depth from the chain are found iteratively,
/// in turn.
struct PressChain {
  std::vector<SagProfile> sure;
  ChainFit fit;
};
[[nodiscard]] PressChain chain_presses(const std::vector<PressRings>& presses);

/// Evaluates a press with a LUT that was made without it, as for a user's press. The one free
/// parameter is the depth of its lowest point; where that was measured, there is none. The result
/// compares the LUT's indentation with the known sphere inside the sure contact. This tests the
/// LUT's slope and bends and the gain at the press's place. It cannot detect a constant offset of
/// the LUT.
struct LeftOutResidual {
  struct Ring {
    double depth_mm = 0;
    double error_mm = 0;  ///< LUT minus sphere.
    double weight = 0;    ///< Pixels.
  };
  std::vector<Ring> rings;  ///< Those within the LUT.
  /// Mean of the errors' sizes; NaN without rings.
  [[nodiscard]] double mean_error_mm() const;
};
[[nodiscard]] LeftOutResidual residual_of(const PressRings& press, const ChainFit& lut);

/// Every press in turn under the chain of all the others.
struct LeaveOneOut {
  std::vector<LeftOutResidual> residuals;  ///< In the presses' order.
  std::vector<ChainFit> without;           ///< The chains that met them.
};
[[nodiscard]] LeaveOneOut leave_one_out(const std::vector<PressRings>& presses);

}  // namespace dtact::calibration
