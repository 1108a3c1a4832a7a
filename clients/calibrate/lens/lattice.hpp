#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace dtact::ctl {

/// A point that stands out from its surroundings.
struct Candidate {
  cv::Point2d px;
  double salience = 0;  ///< Its response over the local RMS response; tried in this order.
};

/// The local maxima of `image` (CV_32F) at about the size `sigma` pixels: differences of Gaussians
/// of sigma and 1.6 sigma.
[[nodiscard]] std::vector<Candidate> find_candidates(const cv::Mat1f& image, double sigma);

/// Points in rows and columns; x grows along a row, y from row to row.
struct Lattice {
  int rows = 0;
  int cols = 0;
  std::vector<std::optional<cv::Point2d>> places;  ///< Row-major; none where nothing was found.
  int found = 0;
};

/// The lattices of rows × cols among the candidates. Neighbours are found from the step between
/// those already found, so the spacing may change across the image; a lattice that grew beyond the
/// board gives several windows of rows and columns. Returns those that miss at most a row or a
/// column more than the fullest, which has at least a quarter of its points.
[[nodiscard]] std::vector<Lattice> find_lattices(const std::vector<Candidate>& candidates, int rows,
                                                 int cols);

}  // namespace dtact::ctl
