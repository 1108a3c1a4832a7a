#include "clients/calibrate/lens/pin_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace dtact::ctl {
namespace {

using recon::Lens;
using recon::Point;

/// Points about a pin to two and a half sigma, about a pixel apart.
std::vector<Point> sample(double sigma, double mm_per_px) {
  const double reach = 2.5 * sigma;
  const int half = std::clamp(static_cast<int>(std::ceil(reach / mm_per_px)), 8, 40);
  std::vector<Point> points;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) {
      const Point p{reach * x / half, reach * y / half};
      if (std::hypot(p.x, p.y) <= reach) points.push_back(p);
    }
  }
  return points;
}

}  // namespace

PinFit::PinFit(const cv::Mat1f& image, double pitch_mm, double mm_per_px)
    : image_(image), sigma_(pitch_mm / 5), points_(sample(sigma_, mm_per_px)) {
  constexpr int kTerms = 10;
  const auto count = static_cast<Eigen::Index>(points_.size());
  Eigen::MatrixXd design(count, kTerms);
  weights_.resize(count);
  Eigen::Index i = 0;
  for (const Point& p : points_) {
    const double x = p.x / sigma_;
    const double y = p.y / sigma_;
    const double weight = std::exp(-(x * x + y * y) / 4);  // the square root of the Gaussian
    const double terms[kTerms] = {1,     x,         y,         x * x,     x * y,
                                  y * y, x * x * x, x * x * y, x * y * y, y * y * y};
    for (int t = 0; t < kTerms; ++t) design(i, t) = weight * terms[t];
    weights_[i++] = weight;
  }
  // The pseudoinverse from the thin QR decomposition: the disc has far more than ten points, so the
  // columns are independent. pseudoInverse() makes a square matrix over all points instead.
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(design);
  const Eigen::MatrixXd thin_q = qr.householderQ() * Eigen::MatrixXd::Identity(count, kTerms);
  solver_ = qr.matrixQR().topRows(kTerms).triangularView<Eigen::Upper>().solve(thin_q.transpose());
}

double PinFit::height_noise(double pixel_noise) const {
  const Eigen::RowVectorXd height = solver_.row(3) + solver_.row(5);
  return pixel_noise * height.cwiseProduct(weights_.transpose()).norm();
}

std::optional<PinFit::Peak> PinFit::find(const Lens& lens, Point start, double reach_mm) const {
  constexpr int kSteps = 40;
  Point at = start;
  for (int step = 0; step < kSteps; ++step) {
    const std::optional<Eigen::VectorXd> fit = fit_at(lens, at);
    if (!fit) return std::nullopt;
    const Eigen::VectorXd& c = *fit;
    const Eigen::Matrix2d bend{{2 * c[3], c[4]}, {c[4], 2 * c[5]}};
    const bool peak = c[3] + c[5] < 0 && bend.determinant() > 0;
    // Uphill by half of Newton's step where the surface is a peak (the cubic terms change with
    // the position, so the slope falls about twice as fast as the bend predicts and the whole step
    // oscillates about the peak), else along the slope; at most half a sigma, the range where the
    // fit is trusted.
    const Eigen::Vector2d slope(c[1], c[2]);
    Eigen::Vector2d move = peak ? Eigen::Vector2d(-0.5 * bend.inverse() * slope) : 1e9 * slope;
    const double size = move.norm();
    if (size > 0.5) move *= 0.5 / size;
    at = {at.x + move[0] * sigma_, at.y + move[1] * sigma_};
    if (std::hypot(at.x - start.x, at.y - start.y) > reach_mm) return std::nullopt;
    if (peak && size < 1e-3) return Peak{at, -(c[3] + c[5])};
  }
  return std::nullopt;
}

std::optional<Eigen::VectorXd> PinFit::fit_at(const Lens& lens, Point at) const {
  Eigen::VectorXd values(weights_.size());
  Eigen::Index i = 0;
  for (const Point& p : points_) {
    const Point px = project(lens, {at.x + p.x, at.y + p.y});
    if (!(px.x > -image_.cols && px.x < 2 * image_.cols && px.y > -image_.rows &&
          px.y < 2 * image_.rows)) {
      return std::nullopt;
    }
    values[i] = weights_[i] * bilinear(px);
    ++i;
  }
  return solver_ * values;
}

/// Beyond the frame its edge is repeated, so that a pin at the edge is not cut off.
double PinFit::bilinear(Point px) const {
  const double x = std::clamp<double>(px.x, 0, image_.cols - 1);
  const double y = std::clamp<double>(px.y, 0, image_.rows - 1);
  const int left = std::min(static_cast<int>(x), image_.cols - 2);
  const int top = std::min(static_cast<int>(y), image_.rows - 2);
  const double fx = x - left;
  const double fy = y - top;
  return (1 - fy) * ((1 - fx) * image_(top, left) + fx * image_(top, left + 1)) +
         fy * ((1 - fx) * image_(top + 1, left) + fx * image_(top + 1, left + 1));
}

}  // namespace dtact::ctl
