#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dtact::recon {

/// How much the same indentation darkens at different places.
enum class GainShape : std::uint8_t {
  none,     ///< Alike everywhere.
  uniform,  ///< Like the reference image's brightness: darkening is a share of the light.
  radial    ///< 1 + per_mm × distance from a centre (the paper's linear regression).
};

/// The part of a calibration that differs from pixel to pixel, in as few numbers as it takes.
struct FlatFieldGain {
  GainShape shape = GainShape::none;
  // For `radial`. Millimetres from the map's centre, x right, y down.
  double centre_x_mm = 0;
  double centre_y_mm = 0;
  double per_mm = 0;  ///< −1 … 1
  /// Times any shape: 1 + Σ polynomial[i] · (x, y, x², xy, y²)[i] of the position in millimetres
  /// from the map's centre, not below zero, for a gel that is thicker on one side or in the middle.
  /// None, two (a plane) or five (a quadratic).
  std::vector<double> polynomial = {};

  /// The polynomial's factor at a position.
  [[nodiscard]] double polynomial_at(double x_mm, double y_mm) const noexcept;
};

/// The same gain, up to a factor that is alike everywhere, with places counted from (x_mm, y_mm) of
/// the old ones. Throws std::invalid_argument when the gain is not above zero there.
[[nodiscard]] FlatFieldGain moved(FlatFieldGain gain, double x_mm, double y_mm);

/// A map's size and scale; rows of a plane are `stride` values apart.
struct PlaneShape {
  int width = 0;
  int height = 0;
  int stride = 0;
  double mm_per_px = 0;
};

/// Turns the smoothed calibration reference (Q6 luma) into what the darkening is brought to: the
/// per-pixel gain is this plane over the present, smoothed reference. `none` leaves it as it is,
/// `uniform` makes it its own mean over what is not dark, `radial` and the polynomial multiply.
void apply(const FlatFieldGain& gain, const PlaneShape& shape,
           std::span<std::int16_t> reference_q6) noexcept;

}  // namespace dtact::recon
