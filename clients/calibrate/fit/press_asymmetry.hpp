#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"

namespace dtact::calibration {

/// How many numbers say by how much one press darkens more on one side than on the other.
enum class AsymmetryOrder : std::uint8_t {
  none,      ///< Alike in all directions.
  plane,     ///< 1 + a·x + b·y
  quadratic  ///< … + c·(x² − y²) + d·2xy
};

/// One press of a ball that is not alike in all directions: its darkening counts that often, about
/// a middle of its own.
///
/// The quadratic has no x² + y²: what falls off alike on all sides is also a bend of the LUT, and
/// a ball cannot tell the two apart. With it a fit reads depth off the place instead of the
/// darkening: on simulated presses that are alike everywhere it finds 0.01 to 0.035 per mm².
///
/// It belongs to the press and is no part of a calibration. A camera at a finite height shows deep
/// places farther out than shallow ones, which looks like a plane of 1 % a millimetre on a press
/// one millimetre off the axis; a ball that was dragged looks like a quadratic. On sensor_b the
/// pins near the ball are alike within 6 % where the press would have them differ by 27 %.
struct PressAsymmetry {
  AsymmetryOrder order = AsymmetryOrder::none;
  /// a, b per mm and c, d per mm², from the contact's centre, x right, y down.
  std::array<double, 4> factors = {};
  /// The ball's middle from the contact's centre, mm; there without a gain.
  double right_mm = 0;
  double down_mm = 0;

  /// How often darkening counts at a place, mm from the contact's centre; 1 there.
  [[nodiscard]] double at(double x_mm, double y_mm) const noexcept;
};

/// The sure part of a contact, a place every tenth of a millimetre: what the fits below look at.
struct PressSample {
  double x_mm = 0;  ///< From the contact's centre.
  double y_mm = 0;
  double level = 0;
};
[[nodiscard]] std::vector<PressSample> sure_samples(const DarkeningMap& map, const Contact& contact,
                                                    const PixelFilter& use = {});

/// Middle, gain and LUT at once, by Gauss and Newton: the LUT's knots are linear unknowns, so
/// that M(gain · level) = g − sag about the middle holds in all samples. Middle and factors are
/// kept near zero as far as the samples leave them open; without a gain the middle stays. The LUT
/// is let go.
[[nodiscard]] PressAsymmetry fit_asymmetry(std::span<const PressSample> samples,
                                           double ball_radius_mm, AsymmetryOrder order);

/// A gain, and what chose its order: the mean distance from the sphere, mm, in the sectors that the
/// fit left out, for each order.
struct ChosenAsymmetry {
  PressAsymmetry gain;
  std::array<double, 3> left_out_mm = {};

  /// In a sentence.
  [[nodiscard]] std::string describe() const;
};

/// Fits each order on every other sector of `sector_deg` and judges it on the rest, both ways and
/// with the sectors turned by half of one. A higher order is taken where that error falls by a
/// twentieth and half a micrometre, and fitted to all samples. None for a contact of less than 2
/// mm².
[[nodiscard]] ChosenAsymmetry choose_asymmetry(std::span<const PressSample> samples,
                                               double ball_radius_mm, double sector_deg = 45);

/// The sector of a place about the contact's centre is one of the even ones.
[[nodiscard]] bool in_even_sector(double x_mm, double y_mm, double sector_deg,
                                  double turned_deg) noexcept;

/// A press with its gain taken off.
struct SymmetricPress {
  DarkeningMap map;  ///< Beyond the contact as on its rim.
  Contact contact;   ///< About the ball's middle.
};
[[nodiscard]] SymmetricPress without_asymmetry(const DarkeningMap& map, const Contact& contact,
                                               const PressAsymmetry& gain);

}  // namespace dtact::calibration
