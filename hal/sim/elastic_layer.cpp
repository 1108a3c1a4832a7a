#include "hal/sim/elastic_layer.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace dtact::hal::sim {
namespace {

constexpr int kMaxIterations = 2000;
// Greatest gap inside the contact and greatest overlap outside it that a solution may have, mm: a
// hundredth of the depth that changes the grey by a tenth of a level.
constexpr double kTolerance_mm = 3e-5;

double compliance(double k, double h, double nu) {
  if (k == 0) return h * (1 + nu) * (1 - 2 * nu) / (1 - nu);
  const double kh = k * h;
  const double half_space = 2 * (1 - nu * nu) / k;
  // The ratio is 1 to the last digit long before cosh overflows.
  if (kh > 20) return half_space;
  const double a = 3 - 4 * nu;
  return half_space * (a * std::sinh(2 * kh) - 2 * kh) /
         (a * std::cosh(2 * kh) + (5 - 12 * nu + 8 * nu * nu) + 2 * kh * kh);
}

}  // namespace

ElasticLayer::ElasticLayer(int width, int height, double spacing_mm, double thickness_mm,
                           double poisson)
    : compliance_(height, width) {
  const double dkx = 2 * std::numbers::pi / (width * spacing_mm);
  const double dky = 2 * std::numbers::pi / (height * spacing_mm);
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      // cv::dft packs real and imaginary parts side by side along the row, except in the first
      // column (and the last of an even width), where they lie one below the other.
      const bool along_column = j == 0 || (j == width - 1 && width % 2 == 0);
      const int nx = (j + 1) / 2;
      const int ny = along_column ? (i + 1) / 2 : std::min(i, height - i);
      compliance_(i, j) = compliance(std::hypot(nx * dkx, ny * dky), thickness_mm, poisson);
    }
  }
}

cv::Mat1d ElasticLayer::indentation(const cv::Mat1d& pressure) const {
  cv::Mat1d spectrum;
  cv::dft(pressure, spectrum);
  cv::multiply(spectrum, compliance_, spectrum);
  cv::Mat1d u;
  cv::idft(spectrum, u, cv::DFT_SCALE);
  return u;
}

// Polonsky and Keer, "A numerical method for solving rough contact problems based on the
// multi-level multi-summation and conjugate gradient techniques", Wear 231 (1999), with the depth
// prescribed instead of the load.
Pressed ElasticLayer::solve(const cv::Mat1d& target_mm, const cv::Mat1d& guess) const {
  CV_Assert(target_mm.size() == compliance_.size() && target_mm.isContinuous());
  const auto n = static_cast<std::size_t>(target_mm.total());
  const double* g = target_mm.ptr<double>();

  Pressed result;
  cv::Mat1d& p_map = result.pressure;
  p_map.create(target_mm.size());
  if (!guess.empty()) {
    cv::max(guess, 0.0, p_map);
  } else {
    // Any positive start will do; the first step finds its scale.
    cv::max(target_mm, 0.0, p_map);
  }
  double* p = p_map.ptr<double>();

  cv::Mat1d t_map(target_mm.size(), 0.0);
  double* t = t_map.ptr<double>();
  cv::Mat1d u_map = indentation(p_map);
  double last_norm = 0;
  bool conjugate = false;
  for (; result.iterations < kMaxIterations; ++result.iterations) {
    const double* u = u_map.ptr<double>();
    double norm = 0;
    double worst = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double gap = u[i] - g[i];
      if (p[i] > 0) norm += gap * gap;
      worst = std::max(worst, p[i] > 0 ? std::abs(gap) : -gap);
    }
    if (worst < kTolerance_mm) {
      result.indentation_mm = u_map;
      return result;
    }
    const double beta = conjugate ? norm / last_norm : 0;
    last_norm = norm;
    for (std::size_t i = 0; i < n; ++i) t[i] = p[i] > 0 ? u[i] - g[i] + beta * t[i] : 0;

    const cv::Mat1d q_map = indentation(t_map);
    const double* q = q_map.ptr<double>();
    double along = 0;
    double curvature = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (p[i] <= 0) continue;
      along += (u[i] - g[i]) * t[i];
      curvature += q[i] * t[i];
    }
    // Without contact there is no direction yet; any small step makes overlapping points meet.
    const double step = curvature > 0 ? along / curvature : 1e-3;

    bool clipped = false;
    bool grown = false;
    for (std::size_t i = 0; i < n; ++i) {
      if (p[i] > 0) {
        p[i] -= step * t[i];
        clipped |= p[i] < 0;
        p[i] = std::max(p[i], 0.0);
      } else if (u[i] < g[i]) {
        p[i] = step * (g[i] - u[i]);
        grown = true;
      }
    }
    conjugate = !grown;
    if (clipped || grown) {
      u_map = indentation(p_map);
    } else {
      u_map -= step * q_map;
    }
  }
  throw std::runtime_error("the contact has no solution: the object fills the gel");
}

}  // namespace dtact::hal::sim
