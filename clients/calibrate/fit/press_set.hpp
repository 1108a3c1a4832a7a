#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/build.hpp"

namespace dtact::calibration {

/// Several presses of one ball, at unknown positions and depths.
struct BallPresses {
  image::Grey16 reference_q8;  ///< Reference image, Q8 luma, the mean of many frames.
  struct Press {
    std::string name;                  ///< Name in messages.
    std::vector<image::Grey8> frames;  ///< The ball pressed in and at rest.
    std::optional<double> depth_mm;    ///< Measured depth of the lowest point, if any.
  };
  std::vector<Press> presses;
  double ball_radius_mm = 0;
  double mm_per_px = 0;
  std::optional<Crop> crop;         ///< None: the whole frame.
  std::optional<recon::Lens> lens;  ///< None: the frame is not rectified.
  CameraView view;                  ///< As in BallPress.
  /// Whether the gain with it comes from a board: if it is none then, darkening is not a share of
  /// the light either.
  bool gain_specified = false;
};

/// The presses of a set that can be used to calibrate.
struct UsablePresses {
  std::vector<SettledPress> presses;
  std::vector<std::size_t> indices;   ///< Of each in BallPresses::presses.
  std::vector<std::string> left_out;  ///< The others: name and reason.
};

/// settle_unclipped() of every press. Those for which it throws std::runtime_error are left out.
[[nodiscard]] UsablePresses settle_each(const recon::Model& model, const BallPresses& set);

/// Findings of build().
struct PressReport {
  struct Depth {
    std::string name;     ///< The press's name.
    double depth_mm = 0;  ///< Fitted depth of the lowest point.
  };
  std::vector<Depth> presses;         ///< Presses that were used.
  std::vector<std::string> left_out;  ///< The others: name and reason.
  /// The choices for the LUT of one press (PressChoices), or why several did not try the share of
  /// the light; else empty.
  std::string note;
  /// A gain that was tried: distance of each press from the known sphere under the LUT of all
  /// others (residual_of()), the mean over the presses.
  struct Gain {
    std::string name;              ///< "none", "share of the light, plane", ...
    double error_mm = 0;           ///< Mean absolute error.
    double standard_error_mm = 0;  ///< Standard error of the difference from the best; 0: the best.
    bool chosen = false;
  };
  std::vector<Gain> gains;  ///< From the simplest on.
};

/// The project's own LUT, from the known sphere only (chain_presses()): from the inner three fifths
/// of each contact, whose radius follows from the fitted depth, not from a circle in the image.
///
/// The gain describes how darkening varies with the position, as simply as the presses allow:
/// none, a share of the light at its place, either with a plane, either with a quadratic. Each is
/// judged by its prediction of presses that LUT and gain were made without (leave_one_out());
/// the simplest within one standard error of the best is chosen. The share is not tried where it
/// finds a press at another position, or fewer than two presses at all.
///
/// The stated uncertainty sums, in squares, that error of the chosen gain, the LUT's change
/// with the presses that make it, 5 % of the depth for objects of another shape, and the influence
/// of the bright ring's light (ring_uncertainty_mm()). The caller fills `origin`.
///
/// A press without a usable contact (too light, beyond the map, white or black) is left out. Throws
/// std::runtime_error when fewer than two remain, naming those left out, and when the presses leave
/// a gap that no press of known depth closes, naming the missing press and those left
/// out. Needs at least two presses.
[[nodiscard]] Calibration build(const BallPresses& set, PressReport* report = nullptr);

/// The paper's linear regression, for comparison: depth = (k·distance + b) · darkening, the
/// distance taken from (centre_x_mm, centre_y_mm) in the map (0, 0 is its centre; the paper moves
/// it to a corner where the light comes from there). After its description: truth is the sphere in
/// each press's published circle, zero on the circle; each pixel gets a slope, by least squares
/// over the presses whose circle holds it; a line is fitted through the slopes against the
/// distance. Pixels brighter than the reference are 0, and the two 7×7 Gaussian filters that follow
/// become one smoothing of the difference: everything in between is linear. Its uncertainty is
/// that of one press (uncertainty_of_zero()).
[[nodiscard]] Calibration build_regression(const BallPresses& set, double centre_x_mm = 0,
                                           double centre_y_mm = 0);

}  // namespace dtact::calibration
