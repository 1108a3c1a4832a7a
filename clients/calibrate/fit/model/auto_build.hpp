#pragma once

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/model/model_lut.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/depth_lut.hpp"

namespace dtact::calibration {

/// What one press's own LUT needs of a gel that was fitted to the press.
struct GelLut {
  const recon::DepthLut* lut = nullptr;
  /// The gel's grey levels for one of the press's own LUT: of the two one may take darkening for
  /// a share of the light and the other not.
  double levels_per_level = 1;

  [[nodiscard]] double read_mm(double level) const;
};

/// The shape of one LUT at the zero of another: `lut`, which its own press shows (fit_lut()) but
/// for its zero, moved so that over the sure part of that press it reads in the mean what the gel
/// reads. From the sure part's edge down to no darkening it hands over to the gel's LUT, which
/// is 0 there, and is that on the bulge. It covers what `lut` covers, and rises throughout.
struct ConstrainedLut {
  recon::DepthLut lut;
  double moved_mm = 0;
};
[[nodiscard]] ConstrainedLut constrain(const recon::DepthLut& lut, const GelLut& gel,
                                       const SymmetricPress& press);

/// Mean darkening of the sure part of a press's contact, grey levels.
[[nodiscard]] double mean_level(const SymmetricPress& press);

/// By how much the depth of a press, millimetres, depends on what of its picture a gel is fitted
/// to: the largest difference from `fit`, made of all of it, among fits of the four halves through
/// the middle, and of what is within 1.5 and within 1.75 radii of the ball. Depth is what the
/// gel's LUT says of the mean level of the sure part. Each fit begins where `fit` ended.
/// Infinity where a part cannot be fitted.
///
/// A gel that is the sensor's, or near enough, says the same from wherever it is looked at: on
/// simulated sensors of the model's law within 0.024 mm, on one of another law within 0.010. On two
/// real presses it is 0.07 and 0.24: what bends the picture there is none of the gel's, and the
/// depth that the fit finds is not to be trusted.
[[nodiscard]] double depth_spread_mm(const SymmetricPress& press, const MapOptics& optics,
                                     const ModelFit& fit);

/// The calibration of one press or several from the known sphere alone, at their measured depths
/// where there are any: build(). `gain`, a lens file's, counts for one press; several tell their
/// own. Throws as build().
[[nodiscard]] Calibration build_from_sphere(const BallPresses& set,
                                            const recon::FlatFieldGain& gain, PressReport& report);

/// The calibration that is best for what the presses show, one or several.
///
/// - A gel is fitted to the whole image of the presses, the bright ring outside the contacts
///   included (build_model()). Where it leaves no more than noise (ModelFit::explains()) its LUT
///   is taken, which knows what its scattering makes of other shapes.
/// - Where it leaves more the sensor is not quite such a gel. Then the LUT's shape is what the
///   presses themselves show inside their contacts, as in build_from_sphere(), but how deep they
///   were, which they do not show, is the gel's: one press's LUT is tied to the gel's
///   (constrain()), several are chained at the gel's depths.
/// - Where no gel can be fitted, where its depth changes with the part of the picture that it is
///   fitted to (depth_spread_mm()), or where depths were measured, it is build_from_sphere()'s.
///
/// `report.note` says which. Stated for one tied press is, in squares, what the gel's fit says of
/// its LUT and by how much the two LUTs differ in shape. Throws as build().
[[nodiscard]] Calibration build_auto(const BallPresses& set, const recon::FlatFieldGain& gain,
                                     PressReport& report);

}  // namespace dtact::calibration
