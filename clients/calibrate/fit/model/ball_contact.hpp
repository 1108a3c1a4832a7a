#pragma once

#include <vector>

namespace dtact::calibration {

/// A rigid ball pressed without friction into a bonded, incompressible, linear-elastic gel: the
/// surface about the contact's axis.
struct BallContact {
  double ball_radius_mm = 0;
  double contact_radius_mm = 0;
  double depth_mm = 0;             ///< Indentation at the lowest point.
  std::vector<double> outside_mm;  ///< Indentation beyond the contact, at outside_place().

  /// Indentation at a distance from the axis, millimetres; negative on the bulge.
  [[nodiscard]] double indentation_mm(double r_mm) const;
};

/// Greatest contact radius in ball radii, and the range of thicknesses in contact radii for which
/// the matrices were laid out.
inline constexpr double kWidestContact = 0.97;
inline constexpr double kMinGelThicknessMm = 0.2;
inline constexpr double kMaxGelThicknessMm = 12;

/// The contact of a given radius. The surface responds to a pressure p with û(k) = C(k)·p̂(k),
///
///     C(k) = 3/(2·E·k) · (sinh 2kh − 2kh) / (cosh 2kh + 1 + 2(kh)²)
///
/// (K. L. Johnson, Contact Mechanics, section 5.8, ν = 0.5). The pressure is a sum of hat functions
/// on the knots sin(πj/2N) of the contact radius, N = 36, which are dense where it falls to
/// zero; that it is zero at the edge determines the depth. In units of the radius
/// everything but kh is fixed, so the Hankel transforms are matrices made once. E cancels.
///
/// Throws std::invalid_argument outside the ranges above.
[[nodiscard]] BallContact press_ball(double ball_radius_mm, double contact_radius_mm,
                                     double thickness_mm);

/// The contact of a ball pressed `depth_mm` deep, to 1e-4 mm; at most as wide as
/// kWidestContact and kMinGelThicknessMm allow.
[[nodiscard]] BallContact press_ball_to(double ball_radius_mm, double depth_mm,
                                        double thickness_mm);

}  // namespace dtact::calibration
