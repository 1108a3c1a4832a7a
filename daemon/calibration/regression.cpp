#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "daemon/calibration/press_set.hpp"
#include "daemon/calibration/published.hpp"

namespace dtact::calibration {
namespace {

constexpr int kThresholdLevel = 2;  // the authors' lighting_threshold
/// Standard deviation of the Gaussian that two 7×7 filters (σ = 1.4 each, OpenCV's choice for that
/// size) amount to, pixels.
constexpr double kTwoFilters = 1.98;

/// depth = (k · distance + b) · level, least squares.
struct Sums {
  double ddll = 0;
  double dll = 0;
  double ll = 0;
  double dlz = 0;
  double lz = 0;

  void add(double distance, double level, double depth) {
    const double dl = distance * level;
    ddll += dl * dl;
    dll += dl * level;
    ll += level * level;
    dlz += dl * depth;
    lz += level * depth;
  }
};

}  // namespace

Calibration build_regression(const BallPresses& set, double centre_x_mm, double centre_y_mm) {
  if (set.presses.empty()) throw std::invalid_argument("no press");
  Calibration calibration = empty_calibration(set.reference_q8, set.crop, set.mm_per_px);
  auto model = std::make_shared<recon::Model>(*calibration.model);
  const Crop crop{calibration.crop_col, calibration.crop_row, model->rectify.width,
                  model->rectify.height};
  const image::Grey8 reference = crop_reference(set.reference_q8, crop);
  Sums sums;
  int most = 0;
  for (const BallPresses::Press& press : set.presses) {
    const image::Grey8 ball = crop_mean(press.frames, crop);
    const Circle circle = published_circle(reference, ball);
    const double radius_mm = circle.radius * set.mm_per_px;
    if (circle.radius < 1 || radius_mm >= set.ball_radius_mm) {
      throw std::runtime_error(fmt::format(
          "{}: no contact of this ball found; press between a tenth and half of its radius",
          press.name));
    }
    const double rim = std::sqrt(set.ball_radius_mm * set.ball_radius_mm - radius_mm * radius_mm);
    for (int y = 0; y < crop.height; ++y) {
      for (int x = 0; x < crop.width; ++x) {
        const double r = std::hypot(x - circle.col, y - circle.row) * set.mm_per_px;
        const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(crop.width) +
                        static_cast<std::size_t>(x);
        const int level = reference.pixels[at] - ball.pixels[at];
        if (r >= radius_mm || level <= kThresholdLevel) continue;
        const double right = (x - 0.5 * (crop.width - 1)) * set.mm_per_px - centre_x_mm;
        const double down = (y - 0.5 * (crop.height - 1)) * set.mm_per_px - centre_y_mm;
        sums.add(std::hypot(right, down), level,
                 std::sqrt(set.ball_radius_mm * set.ball_radius_mm - r * r) - rim);
        most = std::max(most, level);
      }
    }
  }
  const double determinant = sums.ddll * sums.ll - sums.dll * sums.dll;
  if (!(determinant > 0))
    throw std::runtime_error("the presses are all in one place: press elsewhere");
  const double k = (sums.dlz * sums.ll - sums.lz * sums.dll) / determinant;
  const double b = (sums.lz * sums.ddll - sums.dlz * sums.dll) / determinant;
  if (!(b > 0) || std::abs(k / b) > 1) {
    throw std::runtime_error("the images do not darken where the ball presses; check the scale");
  }
  model->gain = {.shape = recon::GainShape::radial,
                 .centre_x_mm = centre_x_mm,
                 .centre_y_mm = centre_y_mm,
                 .per_mm = k / b};
  model->smoothing_px = kTwoFilters;
  // Levels that became deeper by the gain look up further on; brighter than untouched is nothing.
  model->list.first_q6 = 0;
  for (int q6 = 0; q6 <= 250 * recon::kEntriesPerLevel; ++q6) {
    model->list.um.push_back(static_cast<std::int16_t>(
        std::min(16383L, std::lround(1000 * b * q6 / recon::kEntriesPerLevel))));
  }
  model->list.covered_to_q6 = std::min(250, 2 * most) * recon::kEntriesPerLevel;
  calibration.model = std::move(model);
  return calibration;
}

}  // namespace dtact::calibration
