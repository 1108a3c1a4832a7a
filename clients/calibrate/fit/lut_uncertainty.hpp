#pragma once

#include <optional>
#include <span>
#include <vector>

#include "clients/calibrate/fit/build.hpp"

namespace dtact::calibration {

/// Indentations whose errors make one row of what a LUT is uncertain by.
inline constexpr double kDepthBinMm = 0.2;

/// What a LUT is uncertain by that no chain of presses vouches for, from the presses that made it.
/// In squares are added, at each indentation that the LUT reads in them:
///
/// - how far it is there from the known sphere, whose zero is where the darkening's straight line
///   ends (fit_sag()); for a LUT that was zeroed elsewhere, as the published ones are on
///   the contact's edge, that is mostly the distance of the two zeros;
/// - what that zero itself is uncertain by, which nothing in one press shows: one grey level (a
///   LUT made by a ball reads flat objects shallow by about that; 17 robot-measured sensors) and
///   0.15 of the bright ring's. The ring is the gel that bulged; its light scatters into the
///   contact and takes darkening away, more in a deep press than in the shallow ones that are read
///   later. How much depends on the gel. In 36 simulated presses, 0.6 to 1.9 mm deep, on 12
///   sensors of 1.6 to 2.6 mm between those fitted to sensor_a and sensor_b, the zero was too
///   shallow by -0.16 to 0.57 of the ring's level, half of them by 0.08 to 0.28; with 0.15 the mean
///   of true over stated is 1.01. On 27 presses of nine other sensors it is 0.71.
///
/// `depth_mm`: of the lowest point of the one press, where it was measured. Then the sphere is
/// where that puts it, and what the zero is uncertain by is the grey level alone.
///
/// Rows of kDepthBinMm. Empty when no press says anything.
[[nodiscard]] std::vector<recon::Model::Uncertainty> uncertainty_of_zero(
    const recon::DepthLut& lut, std::span<const SettledPress> presses,
    std::optional<double> depth_mm = {});

/// The ring's part of the second alone, millimetres: what its scattered light may make of the
/// press's zero on a LUT of `slope` millimetres a grey level.
[[nodiscard]] double ring_uncertainty_mm(const SettledPress& press, double slope);

}  // namespace dtact::calibration
