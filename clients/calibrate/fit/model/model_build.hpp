#pragma once

#include <string>
#include <vector>

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "clients/calibrate/fit/press_asymmetry.hpp"
#include "clients/calibrate/fit/press_set.hpp"

namespace dtact::calibration {

/// A calibration by a gel that was fitted to presses of a ball (fit_model()), one or several, and
/// the fit. Darkening is a share of the light at its place, unless the dents are much rounder in
/// grey levels or `gain`, the lens file's, says another thing (BallPresses::gain_specified). A
/// press is looked at about the ball's middle and without the press's own gain
/// (choose_asymmetry()), which is no part of the calibration: rings about the centroid of a
/// lopsided dent mix places of different depths. Measured depths play no part. `origin` is left for
/// the caller to fill.
struct FittedCalibration {
  Calibration calibration;
  ModelFit fit;
  double light_levels = 0;                         ///< Grey levels that are all of the light.
  std::vector<PressReport::Depth> presses;         ///< Those that were used.
  std::vector<ChosenAsymmetry> press_asymmetries;  ///< One for each press.
  std::vector<std::string> left_out;  ///< Presses without a usable contact: name and reason.

  /// What one press's gain was chosen by, and how much darker the light was, in a sentence or two;
  /// of several presses nothing.
  [[nodiscard]] std::string describe_press() const;
};

/// Throws ModelRefused when the fit's residual is above half a grey level or a press is deeper than
/// 0.92 of the gel; std::runtime_error and std::invalid_argument as build() on images that show
/// no press.
[[nodiscard]] FittedCalibration build_model(const BallPresses& presses,
                                            const recon::FlatFieldGain& gain = {});

}  // namespace dtact::calibration
