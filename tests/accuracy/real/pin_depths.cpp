#include "tests/accuracy/real/pin_depths.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "daemon/recon/lens.hpp"

namespace dtact::ctl {
namespace {

/// Subtracts the plane through the pins' depths and computes the other results.
void judge(PinDepths& depths, const std::vector<Mark>& marks) {
  const auto n = static_cast<int>(marks.size());
  cv::Mat1d plane(n, 3);
  cv::Mat1d depth(n, 1);
  for (int i = 0; i < n; ++i) {
    const auto pin = static_cast<std::size_t>(i);
    plane(i, 0) = 1;
    plane(i, 1) = marks[pin].mm.x;
    plane(i, 2) = marks[pin].mm.y;
    depth(i) = depths.mm[pin];
  }
  cv::Mat1d fit;
  cv::solve(plane, depth, fit, cv::DECOMP_QR);
  const cv::Mat1d rest(depth - plane * fit);
  depths.mean_mm = cv::mean(depth)[0];
  depths.tilt_x_um_per_mm = 1000 * fit(1);
  depths.tilt_y_um_per_mm = 1000 * fit(2);
  depths.spread = std::sqrt(rest.dot(rest) / n) / depths.mean_mm;
}

/// Depth at a place from a paraboloid through the disc of `reach` pixels about it: the largest
/// single pixel would have the most noise. NaN unless all of the disc is trusted.
double peak_um(const std::vector<float>& um, int width, int height, double col, double row,
               double reach) {
  constexpr int kTerms = 6;
  std::vector<double> terms;
  std::vector<double> depths;
  for (int y = static_cast<int>(std::ceil(row - reach)); y <= row + reach; ++y) {
    for (int x = static_cast<int>(std::ceil(col - reach)); x <= col + reach; ++x) {
      const double dx = (x - col) / reach;
      const double dy = (y - row) / reach;
      if (std::hypot(dx, dy) > 1) continue;
      if (x < 0 || y < 0 || x >= width || y >= height) return std::nan("");
      terms.insert(terms.end(), {1, dx, dy, dx * dx, dx * dy, dy * dy});
      depths.push_back(um[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                          static_cast<std::size_t>(x)]);
    }
  }
  const auto n = static_cast<int>(depths.size());
  if (n < 2 * kTerms) return std::nan("");
  cv::Mat1d fit;
  cv::solve(cv::Mat1d(n, kTerms, terms.data()), cv::Mat1d(n, 1, depths.data()), fit, cv::DECOMP_QR);
  return fit(0);
}

}  // namespace

PinDepths read_pins(const PinPress& pins, const PinGain& gain,
                    const calibration::Calibration& calibration,
                    std::span<const std::uint16_t> reference_q8,
                    std::span<const image::Grey8> frames, const Board& board, int sharpen_steps) {
  const recon::Model& model = *calibration.model;
  const int width = model.rectify.width;
  const std::vector<float> um =
      calibration::mean_depth_um(model, reference_q8, frames, sharpen_steps);
  const recon::MapPlace place{calibration.crop_col, calibration.crop_row, width,
                              model.rectify.height, model.mm_per_px};
  const double reach = board.pitch_mm / 5 / model.mm_per_px;
  PinDepths depths;
  std::vector<Mark> read;  // Pins inside the trusted map.
  for (std::size_t i = 0; i < pins.marks.size(); ++i) {
    const Mark& mark = pins.marks[i];
    const recon::Point at = map_pixel(pins.lens.lens, place, mark.mm);
    const double peak = peak_um(um, width, model.rectify.height, at.x, at.y, reach);
    if (std::isnan(peak)) continue;
    depths.mm.push_back(0.001 * peak * gain.left_out_ratio[i]);
    read.push_back(mark);
  }
  if (4 * read.size() < 3 * pins.marks.size()) {
    throw std::runtime_error(fmt::format("only {} of {} pins lie inside the trusted map",
                                         read.size(), pins.marks.size()));
  }
  judge(depths, read);
  if (!(depths.mean_mm > 0)) throw std::runtime_error("the pins read no depth");
  return depths;
}

}  // namespace dtact::ctl
