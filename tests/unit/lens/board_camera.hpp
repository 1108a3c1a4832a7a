#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <opencv2/core.hpp>
#include <vector>

namespace dtact::ctl {

/// A camera that looks at a plane, computed from rays only: independent of recon::Lens and of
/// OpenCV's calibration. With (x, y) a ray's slopes and r² = x² + y², it shows the ray at the pixel
/// centre + focal·(x, y)·(1 + k1·r² + k2·r⁴ + k3·r⁶).
struct BoardCamera {
  int width = 640;
  int height = 480;
  double focal = 560;  ///< Pixels.
  cv::Point2d centre{320, 240};
  double k1 = 0;
  double k2 = 0;
  double k3 = 0;
  /// The plane: its origin `distance_mm` before the camera and `shift_mm` beside the axis, turned
  /// about the camera's x, then y, then z axis. Degrees.
  double distance_mm = 32;
  cv::Point2d shift_mm{0, 0};
  double tilt_x = 0;
  double tilt_y = 0;
  double turn = 0;

  /// The pixel that shows the plane's point.
  [[nodiscard]] cv::Point2d pixel(cv::Point2d mm) const {
    const cv::Vec3d p = axes() * cv::Vec3d(mm.x, mm.y, 0) + place();
    const cv::Point2d ray(p[0] / p[2], p[1] / p[2]);
    return centre + focal * factor(ray.dot(ray)) * ray;
  }

  /// Grey levels of a pattern on the plane, the mean of `samples`² places in each pixel, with
  /// Gaussian noise.
  [[nodiscard]] cv::Mat1f photograph(const std::function<double(cv::Point2d mm)>& pattern,
                                     int samples, double noise) const {
    const cv::Matx33d to_camera = axes();
    const std::vector<double> factors = factors_seen();
    cv::Mat1f image(height, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (int s = 0; s < samples * samples; ++s) {
          const int column = s % samples;
          const int row = s / samples;
          const cv::Point2d inside((column + 0.5) / samples - 0.5, (row + 0.5) / samples - 0.5);
          sum += pattern(surface(to_camera, factors, cv::Point2d(x, y) + inside));
        }
        image(y, x) = static_cast<float>(sum / (samples * samples));
      }
    }
    cv::Mat1f grain(height, width);
    cv::RNG random(7);
    random.fill(grain, cv::RNG::NORMAL, 0, noise);
    image += grain;
    return image;
  }

 private:
  static constexpr double kFactorsPerSlope = 8192;

  /// factor() of the rays by the slope at which they are seen, up to beyond the image's corners, in
  /// steps of 1 / kFactorsPerSlope.
  [[nodiscard]] std::vector<double> factors_seen() const {
    const double corner = std::hypot(std::max(centre.x, width - centre.x) + 1,
                                     std::max(centre.y, height - centre.y) + 1);
    std::vector<double> factors;
    while (static_cast<double>(factors.size()) < corner / focal * kFactorsPerSlope + 2) {
      const double seen = static_cast<double>(factors.size()) / kFactorsPerSlope;
      double slope = seen;
      for (int i = 0; i < 12; ++i) slope = seen / factor(slope * slope);
      factors.push_back(factor(slope * slope));
    }
    return factors;
  }
  /// The plane's point that a pixel shows.
  [[nodiscard]] cv::Point2d surface(const cv::Matx33d& a, const std::vector<double>& factors,
                                    cv::Point2d px) const {
    const cv::Point2d seen = (px - centre) / focal;
    const double place_in_table = std::hypot(seen.x, seen.y) * kFactorsPerSlope;
    const auto below = static_cast<std::size_t>(place_in_table);
    const double part = place_in_table - static_cast<double>(below);
    const cv::Point2d ray = seen / ((1 - part) * factors[below] + part * factors[below + 1]);
    // a · (X, Y, 0) + place lies along the ray: two equations for X and Y.
    const cv::Vec3d t = place();
    const double xx = a(0, 0) - ray.x * a(2, 0);
    const double xy = a(0, 1) - ray.x * a(2, 1);
    const double yx = a(1, 0) - ray.y * a(2, 0);
    const double yy = a(1, 1) - ray.y * a(2, 1);
    const double right_x = ray.x * t[2] - t[0];
    const double right_y = ray.y * t[2] - t[1];
    const double determinant = xx * yy - xy * yx;
    return {(right_x * yy - xy * right_y) / determinant,
            (xx * right_y - yx * right_x) / determinant};
  }
  [[nodiscard]] double factor(double r2) const { return 1 + r2 * (k1 + r2 * (k2 + r2 * k3)); }
  [[nodiscard]] cv::Vec3d place() const { return {shift_mm.x, shift_mm.y, distance_mm}; }
  [[nodiscard]] cv::Matx33d axes() const {
    constexpr double kDegree = std::numbers::pi / 180;
    const double a = tilt_x * kDegree;
    const double b = tilt_y * kDegree;
    const double c = turn * kDegree;
    const cv::Matx33d about_x(1, 0, 0, 0, std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a));
    const cv::Matx33d about_y(std::cos(b), 0, std::sin(b), 0, 1, 0, -std::sin(b), 0, std::cos(b));
    const cv::Matx33d about_z(std::cos(c), -std::sin(c), 0, std::sin(c), std::cos(c), 0, 0, 0, 1);
    return about_z * about_y * about_x;
  }
};

}  // namespace dtact::ctl
