#include "hal/sim/drag.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace dtact::hal::sim {
namespace {

/// Rows blurred by a Gaussian and turned into columns; zero beyond the border.
cv::Mat1d blurred_across(const cv::Mat1d& map, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<double> taps;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    taps.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
    sum += taps.back();
  }
  cv::Mat1d out(map.cols, map.rows, 0.0);
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.cols; ++column) {
      const int first = std::max(0, column - reach);
      const int last = std::min(map.cols - 1, column + reach);
      for (int k = first; k <= last; ++k) {
        const int tap = k - column + reach;
        out(column, row) += map(row, k) * taps[static_cast<std::size_t>(tap)] / sum;
      }
    }
  }
  return out;
}

double sample(const cv::Mat1d& map, double column, double row) {
  column = std::clamp(column, 0.0, map.cols - 1.001);
  row = std::clamp(row, 0.0, map.rows - 1.001);
  const int left = static_cast<int>(column);
  const int top = static_cast<int>(row);
  return std::lerp(std::lerp(map(top, left), map(top, left + 1), column - left),
                   std::lerp(map(top + 1, left), map(top + 1, left + 1), column - left), row - top);
}

}  // namespace

cv::Mat1d dragged(const cv::Mat1d& indentation_mm, const cv::Mat1d& touching, double x_mm,
                  double y_mm, double thickness_mm, const Grid& grid) {
  cv::Mat1d held(grid.height, grid.width);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      held(row, column) = touching(row, column) > 0 ? 1 : 0;
    }
  }
  const double sigma = thickness_mm / 2 / grid.spacing_mm;
  const cv::Mat1d near = blurred_across(blurred_across(held, sigma), sigma);
  cv::Mat1d out(grid.height, grid.width);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      // Half of what lies around the contact's edge is contact: there all of the drag arrives.
      const double behind = 1 - std::max(held(row, column), std::min(1.0, 2 * near(row, column)));
      out(row, column) = sample(indentation_mm, column + behind * x_mm / grid.spacing_mm,
                                row + behind * y_mm / grid.spacing_mm);
    }
  }
  return out;
}

}  // namespace dtact::hal::sim
