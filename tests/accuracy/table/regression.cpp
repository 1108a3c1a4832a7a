#include "tests/accuracy/table/regression.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/calibration/published.hpp"

namespace dtact::table {
namespace {

/// Two filters of OpenCV's standard deviation for seven taps, 1.4 pixels.
constexpr double kSmoothingPx = 1.98;
constexpr int kLastLevel = 110;

}  // namespace

std::shared_ptr<const recon::Model> fit_regression(const Material& material, double right_mm,
                                                   double down_mm) {
  const image::Grey8 reference = crop8(material.reference_q8);
  const double ball2 = std::pow(material.trial->centre.radius_mm, 2);
  const double middle = 0.5 * (kCrop - 1);
  // Of each pixel's line through zero, depth = slope · level.
  std::vector<double> depth_level(reference.pixels.size());
  std::vector<double> level_level(reference.pixels.size());
  for (const auto& frames : material.many) {
    const image::Grey8 ball = crop8(mean_q8(frames));
    const calibration::Circle circle = calibration::published_circle(reference, ball);
    const double edge2 = std::pow(circle.radius * kMmPerPx, 2);
    std::size_t i = 0;
    for (int y = 0; y < kCrop; ++y) {
      for (int x = 0; x < kCrop; ++x, ++i) {
        const double mm2 =
            (std::pow(x - circle.col, 2) + std::pow(y - circle.row, 2)) * kMmPerPx * kMmPerPx;
        if (mm2 >= edge2 || edge2 >= ball2) continue;
        const double depth = std::sqrt(ball2 - mm2) - std::sqrt(ball2 - edge2);
        const double level = std::max(0, reference.pixels[i] - ball.pixels[i]);
        depth_level[i] += depth * level;
        level_level[i] += level * level;
      }
    }
  }
  // The line through the slopes: normal equations of slope on (r, 1).
  double rr = 0;
  double r1 = 0;
  double one = 0;
  double rd = 0;
  double d1 = 0;
  std::size_t i = 0;
  for (int y = 0; y < kCrop; ++y) {
    for (int x = 0; x < kCrop; ++x, ++i) {
      if (level_level[i] == 0) continue;
      const double slope = depth_level[i] / level_level[i];
      const double r =
          std::hypot((x - middle) * kMmPerPx - right_mm, (y - middle) * kMmPerPx - down_mm);
      rr += r * r;
      r1 += r;
      one += 1;
      rd += r * slope;
      d1 += slope;
    }
  }
  const double determinant = rr * one - r1 * r1;
  const double k_c = (rd * one - d1 * r1) / determinant;
  const double b_c = (rr * d1 - r1 * rd) / determinant;

  auto model = std::make_shared<recon::Model>();
  model->rectify =
      recon::make_crop_table(kFrameWidth, kFrameHeight, kCropCol, kCropRow, kCrop, kCrop);
  model->mm_per_px = kMmPerPx;
  model->smoothing_px = kSmoothingPx;
  model->reference_q8 = material.reference_q8.pixels;
  model->gain = {recon::GainShape::radial, right_mm, down_mm, k_c / b_c};
  for (int q6 = 0; q6 <= kLastLevel * recon::kEntriesPerLevel; ++q6) {
    const double um = 1000 * b_c * q6 / recon::kEntriesPerLevel;
    model->list.um.push_back(static_cast<std::int16_t>(std::lround(um)));
  }
  model->list.covered_to_q6 = kLastLevel * recon::kEntriesPerLevel;
  return model;
}

}  // namespace dtact::table
