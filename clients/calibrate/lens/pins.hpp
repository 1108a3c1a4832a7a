#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "clients/calibrate/lens/point_fit.hpp"

namespace dtact::ctl {

/// A calibration board: pins in a square lattice.
struct Board {
  int rows = 7;
  int cols = 9;
  double pitch_mm = 2.5;
};

/// The board's pins in an image.
struct PinPress {
  /// Counted in the image: a board seen on edge has its rows and columns swapped.
  int rows = 0;
  int cols = 0;
  /// The pins found, row-major from the upper left; millimetres from the board's middle, with level
  /// axes (level()).
  std::vector<Mark> marks;
  /// "row 7, column 2", counted from 1 at the upper left: at most a tenth, fewer than a row.
  std::vector<std::string> missing;
  ChosenLens lens;  ///< Through the marks.
};

/// Finds the pins pressed into the surface. Works on the darkening relative to the light, so that
/// an uneven ring or a dark corner changes nothing, and at several scales, so that the size of the
/// pins in the image need not be known:
///
/// 1. Local maxima of a band pass, joined into lattices (lattice.hpp).
/// 2. A lens through each of those. Then, in the plane of the surface that this lens gives, a
///    third-order surface is fitted to the image about each pin with Gaussian weights of a fifth of
///    the pitch; the pin's centre is where its gradient vanishes. The cubic terms absorb a slope of
///    the surroundings, and in the plane of the surface a pin is round, so that perspective does
///    not pull its centre outwards. Repeated with the better lens.
/// 3. A pin counts as found when the darkening there is a peak, higher than five times its noise
///    and than a fifth of its neighbours' median, within a quarter of the
///    pitch of the position that the others predict and within six times their median distance from
///    the lens. The lattice with the most pins wins, then the most regular one.
///
/// Up to a tenth of the pins may be missing (too faint under stray light, broken off): the lens is
/// sure without them, except at their positions. `reference`, `frame`: grey levels, of one
/// size. Throws std::runtime_error that names the missing pins by row and column when more
/// are missing, or reports that no lattice was found.
[[nodiscard]] PinPress find_pins(const cv::Mat1f& reference, const cv::Mat1f& frame,
                                 const Board& board);

}  // namespace dtact::ctl
