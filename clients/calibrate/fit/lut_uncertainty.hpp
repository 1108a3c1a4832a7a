#pragma once

#include <optional>
#include <span>
#include <vector>

#include "clients/calibrate/fit/build.hpp"

namespace dtact::calibration {

/// Width of the range of indentation in one row of the uncertainty.
inline constexpr double kDepthBinMm = 0.2;

/// Uncertainty of a LUT that is not from a chain of presses, computed from its presses.
/// It sums in squares, at each indentation that the LUT reads in them:
///
/// - the LUT's distance there from the known sphere, whose zero is where the darkening's straight
///   line ends (fit_sag()); for a LUT that was zeroed elsewhere, like the published ones on
///   the contact's edge, this is mostly the distance of the two zeros;
/// - the uncertainty of that zero, which nothing in one press shows: one grey level (a
///   LUT made by a ball reads flat objects shallow by about that; 17 robot-measured sensors) and
///   0.15 of the bright ring's. The ring is the gel that bulged; its light scatters into the
///   contact and reduces the darkening, more in a deep press than in the shallow ones that are read
///   later. The amount depends on the gel. In 36 simulated presses, 0.6 to 1.9 mm deep, on 12
///   sensors of 1.6 to 2.6 mm between those fitted to sensor_a and sensor_b, the zero was too
///   shallow by -0.16 to 0.57 of the ring's level, half of them by 0.08 to 0.28; with 0.15 the mean
///   of true over stated is 1.01. On 27 presses of nine other sensors it is 0.71.
///
/// `depth_mm` of the lowest point of the one press, where measured. Then the sphere is
/// placed by it, and the uncertainty of the zero is the grey level only.
///
/// Rows of kDepthBinMm. Empty when no press can be used.
[[nodiscard]] std::vector<recon::Model::Uncertainty> uncertainty_of_zero(
    const recon::DepthLut& lut, std::span<const SettledPress> presses,
    std::optional<double> depth_mm = {});

/// The ring's part of the second term, millimetres: the influence of its scattered light on the
/// press's zero with a LUT of `slope` millimetres a grey level.
[[nodiscard]] double ring_uncertainty_mm(const SettledPress& press, double slope);

}  // namespace dtact::calibration
