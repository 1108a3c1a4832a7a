#pragma once

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/model/model_list.hpp"
#include "clients/calibrate/fit/press_gain.hpp"
#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/list.hpp"

namespace dtact::calibration {

/// What one press's own list needs of a layer that was fitted to the press.
struct LayerList {
  const recon::DepthList* list = nullptr;
  /// The layer's grey levels for one of the press's own list: of the two one may take darkening for
  /// a share of the light and the other not.
  double levels_per_level = 1;

  [[nodiscard]] double read_mm(double level) const;
};

/// The shape of one list at the zero of another: `list`, which its own press shows (fit_list()) but
/// for its zero, moved so that over the sure part of that press it reads in the mean what the layer
/// reads. From the sure part's edge down to no darkening it hands over to the layer's list, which
/// is 0 there, and is that on the bulge. It covers what `list` covers, and rises throughout.
struct TiedList {
  recon::DepthList list;
  double moved_mm = 0;
};
[[nodiscard]] TiedList tie(const recon::DepthList& list, const LayerList& layer,
                           const LevelledPress& press);

/// Mean darkening of the sure part of a press's contact, grey levels.
[[nodiscard]] double mean_level(const LevelledPress& press);

/// By how much the depth of a press, millimetres, depends on what of its picture a layer is fitted
/// to: the largest difference from `fit`, made of all of it, among fits of the four halves through
/// the middle, and of what is within 1.5 and within 1.75 radii of the ball. Depth is what the
/// layer's list says of the mean level of the sure part. Each fit begins where `fit` ended.
/// Infinity where a part cannot be fitted.
///
/// A layer that is the sensor's, or near enough, says the same from wherever it is looked at: on
/// simulated sensors of the model's law within 0.024 mm, on one of another law within 0.010. On two
/// real presses it is 0.07 and 0.24: what bends the picture there is none of the layer's, and the
/// depth that the fit finds is not to be trusted.
[[nodiscard]] double depth_spread_mm(const LevelledPress& press, const MapOptics& optics,
                                     const ModelFit& fit);

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
