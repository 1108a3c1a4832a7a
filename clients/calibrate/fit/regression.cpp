#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/fit/lut_uncertainty.hpp"
#include "clients/calibrate/fit/press_set.hpp"
#include "clients/calibrate/fit/published.hpp"

namespace dtact::calibration {
namespace {

/// Standard deviation of one Gaussian equal to two 7×7 filters (σ = 1.4 each, OpenCV's choice for
/// that size), pixels.
constexpr double kTwoFilters = 1.98;
constexpr int kLastLevel = 250;  // end of the LUT: a line has none of its own

/// slope = k · distance + b, least squares.
struct Line {
  double k = 0;  ///< Millimetres a grey level and millimetre.
  double b = 0;  ///< Millimetres a grey level.
};
class LineFit {
 public:
  void add(double distance, double slope) {
    dd_ += distance * distance;
    d_ += distance;
    n_ += 1;
    ds_ += distance * slope;
    s_ += slope;
  }
  /// Throws std::runtime_error when all distances are equal.
  [[nodiscard]] Line line() const {
    const double determinant = dd_ * n_ - d_ * d_;
    if (!(determinant > 1e-9 * dd_ * n_)) {
      throw std::runtime_error("the presses are all in one place: press elsewhere, too");
    }
    return {(ds_ * n_ - s_ * d_) / determinant, (dd_ * s_ - ds_ * d_) / determinant};
  }

 private:
  double dd_ = 0;
  double d_ = 0;
  double n_ = 0;
  double ds_ = 0;
  double s_ = 0;
};

/// Slope of each pixel's line through zero, depth = slope · level.
struct PixelSlopes {
  std::vector<double> depth_level;
  std::vector<double> level_level;
};

/// The sphere in the published circle of one press.
void add_press(const image::Grey8& reference, const image::Grey8& ball, const std::string& name,
               double ball_radius_mm, double mm_per_px, PixelSlopes& slopes) {
  const Circle circle = published_circle(reference, ball);
  const double radius_mm = circle.radius * mm_per_px;
  if (circle.radius < 1 || radius_mm >= ball_radius_mm) {
    throw std::runtime_error(fmt::format(
        "{}: no contact of this ball found; press between a tenth and half of its radius", name));
  }
  const double ball2 = ball_radius_mm * ball_radius_mm;
  const double rim = std::sqrt(ball2 - radius_mm * radius_mm);
  std::size_t at = 0;
  for (int y = 0; y < ball.height; ++y) {
    for (int x = 0; x < ball.width; ++x, ++at) {
      const double r = std::hypot(x - circle.col, y - circle.row) * mm_per_px;
      if (r >= radius_mm) continue;
      const double level = std::max(0, reference.pixels[at] - ball.pixels[at]);
      slopes.depth_level[at] += (std::sqrt(ball2 - r * r) - rim) * level;
      slopes.level_level[at] += level * level;
    }
  }
}

}  // namespace

Calibration build_regression(const BallPresses& set, double centre_x_mm, double centre_y_mm) {
  if (set.presses.empty()) throw std::invalid_argument("no press");
  check_sizes(set.ball_radius_mm, set.mm_per_px);
  Calibration calibration =
      empty_calibration(set.reference_q8, set.crop, set.mm_per_px, set.lens, set.view);
  auto model = std::make_shared<recon::Model>(*calibration.model);
  const Crop crop{calibration.crop_col, calibration.crop_row, model->rectify.width,
                  model->rectify.height};
  const image::Grey8 reference = rectified_reference(model->rectify, set.reference_q8);
  PixelSlopes slopes{std::vector<double>(reference.pixels.size()),
                     std::vector<double>(reference.pixels.size())};
  for (const BallPresses::Press& press : set.presses) {
    add_press(reference, rectified_mean(model->rectify, press.frames), press.name,
              set.ball_radius_mm, set.mm_per_px, slopes);
  }
  LineFit fit;
  std::size_t at = 0;
  for (int y = 0; y < crop.height; ++y) {
    for (int x = 0; x < crop.width; ++x, ++at) {
      if (slopes.level_level[at] == 0) continue;
      fit.add(std::hypot((x - 0.5 * (crop.width - 1)) * set.mm_per_px - centre_x_mm,
                         (y - 0.5 * (crop.height - 1)) * set.mm_per_px - centre_y_mm),
              slopes.depth_level[at] / slopes.level_level[at]);
    }
  }
  const auto [k, b] = fit.line();
  if (!(b > 0) || std::abs(k / b) > 1) {
    throw std::runtime_error("the images do not darken where the ball presses; check the scale");
  }
  model->gain = {.shape = recon::GainShape::radial,
                 .centre_x_mm = centre_x_mm,
                 .centre_y_mm = centre_y_mm,
                 .per_mm = k / b};
  model->smoothing_px = kTwoFilters;
  // Levels that the gain increases are looked up further on; brighter than the reference is 0.
  model->lut.first_q6 = 0;
  for (int q6 = 0; q6 <= kLastLevel * recon::kEntriesPerLevel; ++q6) {
    model->lut.um.push_back(static_cast<std::int16_t>(
        std::min(16383L, std::lround(1000 * b * q6 / recon::kEntriesPerLevel))));
  }
  model->lut.covered_to_q6 = kLastLevel * recon::kEntriesPerLevel;
  // The published circle needs less than a usable contact, so some presses may be missing here.
  model->uncertainty = uncertainty_of_zero(model->lut, settle_each(*model, set).presses);
  calibration.model = std::move(model);
  return calibration;
}

}  // namespace dtact::calibration
