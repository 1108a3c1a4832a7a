#pragma once

#include <string>
#include <vector>

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "clients/calibrate/fit/press_set.hpp"

namespace dtact::calibration {

/// A calibration from a gel that was fitted to presses of a ball (fit_model()), one or several, and
/// the fit. Darkening is a share of the light at its place, unless the dents are much rounder in
/// grey levels or `gain`, the lens file's, says otherwise (BallPresses::gain_specified). A
/// press is centred on the ball's middle and freed of the press's own gain
/// (choose_asymmetry()), which is not part of the calibration: rings about the centroid of an
/// asymmetric dent mix pixels of different depths. Measured depths are not used. The caller fills
/// `origin`.
struct FittedCalibration {
  Calibration calibration;
  ModelFit fit;
  double light_levels = 0;                         ///< Grey levels of the full light.
  std::vector<PressReport::Depth> presses;         ///< Presses that were used.
  std::vector<ChosenAsymmetry> press_asymmetries;  ///< One for each press.
  std::vector<std::string> left_out;  ///< Presses without a usable contact: name and reason.

  /// The basis of one press's gain, and the darkening of the light, in a sentence or two;
  /// empty for several presses.
  [[nodiscard]] std::string describe_press() const;
};

/// Throws ModelRefused when the fit's residual is above half a grey level or a press is deeper than
/// 0.92 of the gel; std::runtime_error and std::invalid_argument like build() on images without a
/// usable press.
[[nodiscard]] FittedCalibration build_model(const BallPresses& presses,
                                            const recon::FlatFieldGain& gain = {});

}  // namespace dtact::calibration
