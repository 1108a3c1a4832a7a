#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "clients/calibrate/lens/pin_shift.hpp"
#include "clients/calibrate/lens/pins.hpp"
#include "clients/calibrate/lens/point_fit.hpp"
#include "daemon/recon/flat_field_gain.hpp"

namespace dtact::ctl {

/// Flat-field gain from the pins of a board, all equally long: variation of the darkening of the
/// same dent over the map.
struct PinGain {
  recon::FlatFieldGain gain;  ///< Places in millimetres of the marks.
  /// RMS of the relative error with which the others predict each pin's darkening: with no gain,
  /// with the share of the light, with a quadratic.
  std::vector<double> left_out_of_each;
  /// For each mark, the gain that the others chose at its place over the one above.
  std::vector<double> left_out_ratio;

  /// A description of one sentence.
  [[nodiscard]] std::string describe() const;
};

/// Chooses the gain: none; the share of the light (a lens that darkens towards its corners, an
/// uneven ring); a quadratic of the position (a gel thicker in the middle). A later one is used
/// only when the left-out pins are clearly better predicted (clearly_lower()). A plane is
/// no choice: it is always removed, since a tilted board looks the same.
///
/// `reference`, `frame`: grey levels; `marks`: from find_pins(), at least twelve;
/// `smoothing_px`: standard deviation of the Gaussian with which the darkening is read.
[[nodiscard]] PinGain choose_gain(const cv::Mat1f& reference, const cv::Mat1f& frame,
                                  std::span<const Mark> marks, double smoothing_px);

/// What one press of a board of pins shows.
struct BoardLens {
  PinPress pins;  ///< With the lens of the undeformed surface, where `shift` is sure.
  PinGain gain;
  PinShift shift;
};
/// Throws as find_pins().
[[nodiscard]] BoardLens measure_board(const cv::Mat1f& reference, const cv::Mat1f& frame,
                                      const Board& board, double smoothing_mm);

}  // namespace dtact::ctl
