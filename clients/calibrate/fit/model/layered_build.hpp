#pragma once

#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/calibration/calibration.hpp"

namespace dtact::calibration {

/// The calibration of one press or several from the known sphere alone, at their measured depths
/// where there are any: build(). `gain`, a lens file's, counts for one press; several tell their
/// own. Throws as build().
[[nodiscard]] Calibration build_alone(const BallPresses& set, const recon::SpatialGain& gain,
                                      PressReport& report);

/// The calibration that is best for what the presses show, one or several.
///
/// - A layer is fitted to the whole image of the presses, the bright ring outside the contacts
///   included (build_model()). Where it leaves no more than noise (ModelFit::explains()) its list
///   is taken, which knows what its scattering makes of other shapes.
/// - Where it leaves more the sensor is not quite such a layer. Then the list's shape is what the
///   presses themselves show inside their contacts, as in build_alone(), but how deep they were,
///   which they do not show, is the layer's: one press's list is tied to the layer's (tie()),
///   several are chained at the layer's depths.
/// - Where no layer can be fitted, where its depth changes with the part of the picture that it is
///   fitted to (depth_spread_mm()), or where depths were measured, it is build_alone()'s.
///
/// `report.note` says which. Stated for one tied press is, in squares, what the layer's fit says of
/// its list and by how much the two lists differ in shape. Throws as build().
[[nodiscard]] Calibration build_layered(const BallPresses& set, const recon::SpatialGain& gain,
                                        PressReport& report);

}  // namespace dtact::calibration
