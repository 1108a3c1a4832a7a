#pragma once

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/model/model_list.hpp"

namespace dtact::calibration {

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

}  // namespace dtact::calibration
