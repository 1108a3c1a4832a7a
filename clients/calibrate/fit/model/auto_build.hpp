#pragma once

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/model/model_lut.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/depth_lut.hpp"

namespace dtact::calibration {

/// The parts of a gel fitted to a press that the press's own LUT needs.
struct GelLut {
  const recon::DepthLut* lut = nullptr;
  /// The gel's grey levels for one of the press's own LUT: only one of the two may treat darkening
  /// as a share of the light.
  double levels_per_level = 1;

  [[nodiscard]] double read_mm(double level) const;
};

/// One press's LUT with the zero of the gel's: `lut` (fit_lut()) is moved so that over the sure
/// part of its press its mean reading equals the gel's. From the sure part's edge down to no
/// darkening it blends into the gel's LUT, which is 0 there, and equals it on the bulge. It covers
/// the same range as `lut`, and rises throughout.
struct ConstrainedLut {
  recon::DepthLut lut;
  double moved_mm = 0;
};
[[nodiscard]] ConstrainedLut constrain(const recon::DepthLut& lut, const GelLut& gel,
                                       const SymmetricPress& press);

/// Mean darkening of the sure part of a press's contact, grey levels.
[[nodiscard]] double mean_level(const SymmetricPress& press);

/// Dependence of a press's depth, millimetres, on the part of the picture to which a gel is fitted:
/// the largest difference from `fit`, made of the whole picture, among fits of the four halves
/// through the middle and of the parts within 1.5 and within 1.75 radii of the ball. Depth is the
/// gel's LUT at the mean level of the sure part. Each fit begins where `fit` ended.
/// Infinity where a part cannot be fitted.
///
/// If the gel is the sensor's, or close to it, all parts give the same depth: on
/// simulated sensors of the model's law within 0.024 mm, on one of another law within 0.010. On two
/// real presses it is 0.07 and 0.24: there the gel does not explain the picture, and the
/// depth of the fit is not to be trusted.
[[nodiscard]] double depth_spread_mm(const SymmetricPress& press, const MapOptics& optics,
                                     const ModelFit& fit);

/// The calibration of one press or several from the known sphere only, at their measured depths
/// where given: build(). `gain`, a lens file's, counts for one press; several determine their
/// own. Throws like build().
[[nodiscard]] Calibration build_from_sphere(const BallPresses& set,
                                            const recon::FlatFieldGain& gain, PressReport& report);

/// The best calibration for the presses, one or several.
///
/// - A gel is fitted to the whole image of the presses, the bright ring outside the contacts
///   included (build_model()). Where the residual is only noise (ModelFit::explains()) its LUT
///   is used; it includes the effect of scattering on other shapes.
/// - Where the residual is larger the sensor differs from the model. Then the LUT's shape is that
///   of the presses inside their contacts, as in build_from_sphere(), but their depth, which
///   they do not show, is the gel's: one press's LUT is constrained by the gel's
///   (constrain()), several are chained at the gel's depths.
/// - Where no gel can be fitted, where its depth depends on the part of the picture that it is
///   fitted to (depth_spread_mm()), or where depths were measured, it is build_from_sphere()'s.
///
/// `report.note` names the case. The uncertainty for one constrained press sums, in squares, the
/// uncertainty of the gel's LUT and the difference of the two LUTs in shape. Throws like build().
[[nodiscard]] Calibration build_auto(const BallPresses& set, const recon::FlatFieldGain& gain,
                                     PressReport& report);

}  // namespace dtact::calibration
