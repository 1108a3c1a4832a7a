#pragma once

#include <array>

namespace dtact::recon {

/// A normal force, newtons, and the mean absolute error to expect of it.
struct Force {
  double newtons = 0;  ///< ≥ 0
  double uncertainty_n = 0;
};

/// The force along the surface's normal that a contact's volume V (mm³) and area A (mm²) stand for,
/// as a user's scale calibrated it:
///
///     F = per_mm3 V + per_mm2 A + per_mm5 V A
///
/// A bonded incompressible layer resists mostly in proportion to V; it is the stiffer the wider the
/// contact is for its thickness, which is the last term; and the second makes up for what lies
/// below the threshold. Without a contact there is no force.
struct ForceModel {
  double per_mm3 = 0;
  double per_mm2 = 0;
  double per_mm5 = 0;
  double threshold_mm = 0;  ///< V and A are those of what is pressed deeper than this, …
  int sharpen_steps = 0;    ///< … in a map of levels sharpened by so many steps.
  double error_n = 0;       ///< Mean absolute error of readings that were left out of the fit.
  /// How fast the error grows away from the readings: with x = (V, A, V A) it is error_n ·
  /// √(1 + xᵀ S x). The upper triangle of S, row by row.
  std::array<double, 6> spread{};
  int pairs = 0;      ///< Readings that made it, …
  double from_n = 0;  ///< … the smallest and the greatest of them.
  double to_n = 0;
};

[[nodiscard]] Force force_of(const ForceModel& model, double volume_mm3, double area_mm2) noexcept;

}  // namespace dtact::recon
