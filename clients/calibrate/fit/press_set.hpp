#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/build.hpp"

namespace dtact::calibration {

/// Several presses of one ball, at places and depths that nobody needs to know.
struct BallPresses {
  image::Grey16 reference_q8;  ///< Untouched, Q8 luma, the mean of many frames.
  struct Press {
    std::string name;                  ///< In messages.
    std::vector<image::Grey8> frames;  ///< The ball pressed in and at rest.
    std::optional<double> depth_mm;    ///< Measured depth of the lowest point, if any.
  };
  std::vector<Press> presses;
  double ball_radius_mm = 0;
  double mm_per_px = 0;
  std::optional<Crop> crop;         ///< None: all that the frame shows.
  std::optional<recon::Lens> lens;  ///< None: the frame as it is.
  /// The gain that goes with it is a board's answer: where it is none, darkening is no share of the
  /// light either.
  bool gain_specified = false;
};

/// What build() found out on the way.
struct PressReport {
  struct Depth {
    std::string name;     ///< The press's name.
    double depth_mm = 0;  ///< Fitted depth of the lowest point.
  };
  std::vector<Depth> presses;         ///< Those that were used.
  std::vector<std::string> left_out;  ///< The others: name and reason.
  /// What the LUT of one press chose (PressChoices), or why several did not try the share of the
  /// light; else empty.
  std::string note;
  /// A gain that was tried: how far each press is from the known sphere under the LUT of all
  /// others (residual_of()), the mean over the presses.
  struct Gain {
    std::string name;              ///< "none", "share of the light, plane", ...
    double error_mm = 0;           ///< Mean absolute error.
    double standard_error_mm = 0;  ///< Of the difference from the best; 0: the best.
    bool chosen = false;
  };
  std::vector<Gain> gains;  ///< From the simplest on.
};

/// Ours. The LUT follows from the known sphere alone (chain_presses()): in the inner three fifths
/// of each contact, whose radius follows from the fitted depth, not from a circle in the image.
///
/// How darkening differs from place to place is told by the gain, as simple as the presses allow:
/// none, a share of the light at its place, either with a plane, either with a quadratic. Each is
/// judged by how well it predicts presses that LUT and gain were made without (leave_one_out());
/// taken is the simplest within one standard error of the best. The share is not tried where it
/// finds a press elsewhere than it is.
///
/// What the LUT says of its own uncertainty is that error of the chosen one, how much the LUT
/// moves with the presses that make it, 5 % of the depth for objects of another shape, and what the
/// bright ring's light may do (ring_uncertainty_mm()), added in squares. `origin` is left for the
/// caller to fill.
///
/// A press without a contact that can be used (too light, beyond the map) is left out. Throws
/// std::runtime_error when fewer than two remain, naming those left out, and when the presses leave
/// a gap that no press of known depth closes, saying which press is missing and which were left
/// out. At least two presses.
[[nodiscard]] Calibration build(const BallPresses& set, PressReport* report = nullptr);

/// The paper's linear regression, to compare with: depth = (k·distance + b) · darkening, the
/// distance taken from (centre_x_mm, centre_y_mm) in the map (0, 0 is its centre; the paper moves
/// it to a corner where the light comes from there). As it is described: truth is the sphere in
/// each press's published circle, zero on the circle; each pixel gets a slope, by least squares
/// over the presses whose circle holds it; a line is fitted through the slopes against the
/// distance. What is brighter than untouched is 0, and the two 7×7 Gaussian filters that follow
/// become one smoothing of the difference: everything in between is linear. Its uncertainty is
/// said as for one press (uncertainty_of_zero()).
[[nodiscard]] Calibration build_regression(const BallPresses& set, double centre_x_mm = 0,
                                           double centre_y_mm = 0);

}  // namespace dtact::calibration
