#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "clients/calibrate/lens/point_fit.hpp"

namespace dtact::ctl {

/// A chessboard: its inner corners are one fewer each way than its squares.
struct Chessboard {
  int cols = 0;  ///< Squares.
  int rows = 0;  ///< Squares.
  double square_mm = 0;
};

/// A lens from chessboards. The first image's board is on the surface and fixes scale and position;
/// the millimetres' origin is the middle of its corners.
struct ChessboardLens {
  ChosenLens lens;          ///< Through the first image's corners, or through all images'.
  std::vector<Mark> marks;  ///< The first image's corners.
};

/// One image: the lens through its corners, as through the pins of a board (choose_lens). Four and
/// more: OpenCV's camera calibration over all with square pixels and one to three radial terms, the
/// number chosen by leaving out one image at a time; its residuals are then those of the first
/// image's corners, left out with its image. Images are 8-bit grey; `names` appear in errors.
/// Throws std::runtime_error naming the image without a board, and for two or three images.
[[nodiscard]] ChessboardLens calibrate_chessboards(const std::vector<cv::Mat1b>& images,
                                                   const std::vector<std::string>& names,
                                                   const Chessboard& board);

}  // namespace dtact::ctl
