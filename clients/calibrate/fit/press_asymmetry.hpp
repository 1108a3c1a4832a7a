#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"

namespace dtact::calibration {

/// Number of terms of the asymmetry of one press.
enum class AsymmetryOrder : std::uint8_t {
  none,      ///< Symmetric.
  plane,     ///< 1 + a·x + b·y
  quadratic  ///< … + c·(x² − y²) + d·2xy
};

/// Asymmetry of one press of a ball: a factor on its darkening, about
/// a middle of its own.
///
/// The quadratic has no x² + y²: a fall-off that is equal on all sides is also a bend of the LUT,
/// and a ball cannot separate the two. With it a fit reads depth from the position instead of the
/// darkening: on simulated symmetric presses it finds 0.01 to 0.035 per mm².
///
/// It belongs to the press and is not part of a calibration. A camera at a finite height shows deep
/// points farther out than shallow ones, which looks like a plane of 1 % a millimetre on a press
/// one millimetre off the axis; a ball that was dragged looks like a quadratic. On sensor_b the
/// pins near the ball are equal within 6 % where the press would have them differ by 27 %.
struct PressAsymmetry {
  AsymmetryOrder order = AsymmetryOrder::none;
  /// a, b per mm and c, d per mm², from the contact's centre, x right, y down.
  std::array<double, 4> factors = {};
  /// The ball's middle from the contact's centre, mm; zero without a gain.
  double right_mm = 0;
  double down_mm = 0;

  /// Factor on darkening at a position, mm from the contact's centre; 1 there.
  [[nodiscard]] double at(double x_mm, double y_mm) const noexcept;
};

/// The sure part of a contact, a point every tenth of a millimetre: input of the fits below.
struct PressSample {
  double x_mm = 0;  ///< From the contact's centre.
  double y_mm = 0;
  double level = 0;
};
[[nodiscard]] std::vector<PressSample> sure_samples(const DarkeningMap& map, const Contact& contact,
                                                    const PixelFilter& use = {});

/// Fits middle, gain and LUT together, by Gauss and Newton: the LUT's knots are linear unknowns, so
/// that M(gain · level) = g − sag about the middle holds in all samples. Middle and factors are
/// kept near zero as far as the samples leave them open; without a gain the middle stays. The LUT
/// is discarded.
[[nodiscard]] PressAsymmetry fit_asymmetry(std::span<const PressSample> samples,
                                           double ball_radius_mm, AsymmetryOrder order);

/// A gain, and the errors that chose its order: the mean distance from the sphere, mm, in the
/// sectors that the fit left out, for each order. Unset: the contact is too small to leave any out.
struct ChosenAsymmetry {
  PressAsymmetry gain;
  std::optional<std::array<double, 3>> left_out_mm;

  /// A description of one sentence.
  [[nodiscard]] std::string describe() const;
};

/// Fits each order on every other sector of `sector_deg` and judges it on the rest, both ways and
/// with the sectors turned by half of one. A higher order is used where that error falls by a
/// twentieth and half a micrometre, and fitted to all samples. None for a contact of less than 2
/// mm².
[[nodiscard]] ChosenAsymmetry choose_asymmetry(std::span<const PressSample> samples,
                                               double ball_radius_mm, double sector_deg = 45);

/// Whether a position about the contact's centre is in an even sector.
[[nodiscard]] bool in_even_sector(double x_mm, double y_mm, double sector_deg,
                                  double turned_deg) noexcept;

/// A press with its gain removed.
struct SymmetricPress {
  DarkeningMap map;  ///< Beyond the contact the values of its rim.
  Contact contact;   ///< About the ball's middle.
};
[[nodiscard]] SymmetricPress without_asymmetry(const DarkeningMap& map, const Contact& contact,
                                               const PressAsymmetry& gain);

}  // namespace dtact::calibration
