#pragma once

#include <Eigen/Core>
#include <array>

#include "clients/calibrate/fit/model/ball_contact.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// The share of the local light that an indentation blocks, before it scatters sideways: its slope
/// over indentation / thickness is a straight line between knots and constant beyond them. The
/// remaining share depends on the remaining share of the gel, so one curve serves every
/// thickness.
struct Response {
  static constexpr std::array<double, 5> kKnots = {-0.24, -0.12, 0, 0.4, 0.8};

  std::array<double, 5> slopes = {};  ///< Share of the light for each thickness indented; > 0.
  double bulge_factor = 1;            ///< On all slopes below zero: a kink there.

  /// Loss at an indentation as a multiple of the thickness; 0 at 0.
  [[nodiscard]] double loss(double indentation) const;

  bool operator==(const Response&) const = default;
};

/// The gel and its light in a predicted press.
struct GelModel {
  double thickness_mm = 0;
  Response response;
  recon::Scattering scattering;
};

/// A ball press on RadialTransform's grid.
struct PredictedPress {
  Eigen::VectorXd indentation_mm;
  Eigen::VectorXd spectrum;  ///< The loss before scattering.
};

[[nodiscard]] PredictedPress predict_press(const GelModel& gel, const BallContact& contact);

/// The factor of scattering on each wave number of RadialTransform, 1 at 0.
[[nodiscard]] Eigen::VectorXd scattered(const recon::Scattering& scattering);
/// The same for a Gaussian of standard deviation `sigma_mm`.
[[nodiscard]] Eigen::VectorXd blurred(double sigma_mm);
/// The factor of `steps` of x ← x + L − Hx, from x = L, on each wave number, H as scattered():
/// Σ (1 − H)ⁱ, i = 0 … steps (Van Cittert 1931).
[[nodiscard]] Eigen::VectorXd sharpened(const Eigen::VectorXd& scattering, int steps);

}  // namespace dtact::calibration
