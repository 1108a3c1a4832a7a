#include "clients/calibrate/fit/model/ball_contact.hpp"

#include <fmt/format.h>
#include <math.h>  // ::j0: the C++ Bessel functions are ten times slower

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>

#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

constexpr Eigen::Index kHats = 36;
/// Beyond the edge the surface leaves the ball with the power 3/2 of the distance: on positions
/// that grow with the square of the index it is smooth.
constexpr Eigen::Index kOutside = 96;
constexpr double kFarthest = 14;  // radii

double outside_place(double index) {
  const double part = index / static_cast<double>(kOutside - 1);
  return 1 + (kFarthest - 1) * part * part;
}

/// The relative difference of the response of a gel of thickness x / k from a half-space's:
/// (sinh 2x − 2x) / (cosh 2x + 1 + 2x²) − 1, written without cancellation.
double layer_minus_half_space(double x) {
  return -(std::exp(-2 * x) + 2 * x + 1 + 2 * x * x) / (std::cosh(2 * x) + 1 + 2 * x * x);
}

/// Argument at which that has fallen to 1e-9.
constexpr double kNoGelLeft = 13;

double knot(Eigen::Index j) {
  return std::sin(std::numbers::pi * static_cast<double>(j) / (2 * static_cast<double>(kHats)));
}

/// Hat function j on one of its sides.
double hat(Eigen::Index j, bool rising, double s) {
  return rising ? (s - knot(j - 1)) / (knot(j) - knot(j - 1))
                : (knot(j + 1) - s) / (knot(j + 1) - knot(j));
}

/// ∫ hat_j(s)·kernel(s) ds by `points(from, to, add)`.
template <typename Kernel, typename Points>
double over_hat(Eigen::Index j, const Kernel& kernel, const Points& points) {
  double sum = 0;
  for (const bool rising : {true, false}) {
    if (rising && j == 0) continue;
    points(rising ? knot(j - 1) : knot(j), rising ? knot(j) : knot(j + 1),
           [&](double s, double weight) { sum += weight * hat(j, rising, s) * kernel(s); });
  }
  return sum;
}

/// Points for an integrand with a logarithm at `pole`: panels halve towards it.
template <typename Add>
void for_points_about(double pole, double from, double to, const Add& add) {
  if (from < pole && pole < to) {
    for_points_about(pole, from, pole, add);
    for_points_about(pole, pole, to, add);
    return;
  }
  const bool below = pole >= to;
  const double near = below ? to : from;  // the end next to the pole
  const double far = below ? from : to;
  const double gap = std::abs(near - pole);
  double outer = far;
  // A panel no longer than its distance from the pole is smooth enough; the last one, 2^-20 of the
  // first, is negligible.
  for (int halvings = 0; halvings < 20 && std::abs(outer - near) > gap; ++halvings) {
    const double inner = near + 0.5 * (outer - near);
    for_gauss_points(std::min(inner, outer), std::max(inner, outer), add);
    outer = inner;
  }
  for_gauss_points(std::min(near, outer), std::max(near, outer), add);
}

/// A half-space's response at ρ to hat j, without the factor 3/2·a:
/// ∫ hat(s)·s·∫ J₀(κρ)·J₀(κs) dκ ds, the inner one 2/(π·max)·K(min/max) (Gradshteyn and Ryzhik
/// 6.512).
double half_space(Eigen::Index j, double rho) {
  const auto kernel = [rho](double s) {
    const double larger = std::max(rho, s);
    return s * 2 / (std::numbers::pi * larger) * std::comp_ellint_1(std::min(rho, s) / larger);
  };
  return over_hat(j, kernel, [rho](double from, double to, const auto& add) {
    for_points_about(rho, from, to, add);
  });
}

/// Everything that does not depend on the press: lengths in contact radii.
struct Matrices {
  Eigen::VectorXd kappa;      ///< Wave numbers, ascending.
  Eigen::VectorXd weight;     ///< Quadrature weights over them.
  Eigen::MatrixXd transform;  ///< Hankel transform of each hat, a column each.
  Eigen::MatrixXd inside;     ///< J₀(κρ) at the knots, a column each.
  Eigen::MatrixXd outside;    ///< The same beyond.
  Eigen::MatrixXd half_inside;
  Eigen::MatrixXd half_outside;

  Matrices() {
    lay_out_kappa();
    const Eigen::Index count = kappa.size();
    transform.resize(count, kHats);
    inside.resize(count, kHats + 1);
    outside.resize(count, kOutside);
    const auto smooth = [](double from, double to, const auto& add) {
      for_gauss_points(from, to, add);
    };
    for (Eigen::Index i = 0; i < count; ++i) {
      const double k = kappa[i];
      for (Eigen::Index j = 0; j < kHats; ++j) {
        transform(i, j) = over_hat(j, [k](double s) { return s * ::j0(k * s); }, smooth);
      }
      for (Eigen::Index j = 0; j <= kHats; ++j) inside(i, j) = ::j0(k * knot(j));
      for (Eigen::Index j = 0; j < kOutside; ++j) {
        outside(i, j) = ::j0(k * outside_place(static_cast<double>(j)));
      }
    }
    half_inside.resize(kHats + 1, kHats);
    half_outside.resize(kOutside, kHats);
    for (Eigen::Index j = 0; j < kHats; ++j) {
      for (Eigen::Index i = 0; i <= kHats; ++i) half_inside(i, j) = half_space(j, knot(i));
      for (Eigen::Index i = 0; i < kOutside; ++i) {
        half_outside(i, j) = half_space(j, outside_place(static_cast<double>(i)));
      }
    }
  }

 private:
  void lay_out_kappa() {
    // Narrow panels for thick gels, whose response is at small wave numbers, wide ones up to
    // where the thinnest is a half-space; J₀ at the farthest position turns once a panel.
    std::vector<double> nodes;
    std::vector<double> weights;
    const double last = kNoGelLeft / kMinGelThicknessMm;
    for (double from = 0; from < last;) {
      const double to = from + (from < 0.5 ? 0.0625 : 0.4);
      for_gauss_points(from, to, [&](double k, double w) {
        nodes.push_back(k);
        weights.push_back(w);
      });
      from = to;
    }
    const auto count = static_cast<Eigen::Index>(nodes.size());
    kappa = Eigen::Map<Eigen::VectorXd>(nodes.data(), count);
    weight = Eigen::Map<Eigen::VectorXd>(weights.data(), count);
  }
};

const Matrices& matrices() {
  static const Matrices made;
  return made;
}

/// Between samples at whole indices, cubic (Catmull and Rom 1974); `before` stands for index −1.
double cubic(const std::vector<double>& values, double index, double before) {
  const auto last = static_cast<std::ptrdiff_t>(values.size()) - 1;
  const auto i = std::min(static_cast<std::ptrdiff_t>(index), last - 1);
  const double t = index - static_cast<double>(i);
  const auto at = [&](std::ptrdiff_t n) {
    return n < 0 ? before : values[static_cast<std::size_t>(std::min(n, last))];
  };
  const double p0 = at(i - 1);
  const double p1 = at(i);
  const double p2 = at(i + 1);
  const double p3 = at(i + 2);
  return p1 +
         0.5 * t * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
}

double sag(double ball_radius_mm, double r_mm) {
  return ball_radius_mm - std::sqrt(ball_radius_mm * ball_radius_mm - r_mm * r_mm);
}

}  // namespace

double BallContact::indentation_mm(double r_mm) const {
  if (r_mm <= contact_radius_mm) return depth_mm - sag(ball_radius_mm, r_mm);
  const double part = (r_mm / contact_radius_mm - 1) / (kFarthest - 1);
  if (part >= 1) return 0;
  // The index is proportional to the root of the distance: to the other side of the edge it is an
  // even function of it up to the power 3/2.
  return cubic(outside_mm, std::sqrt(part) * static_cast<double>(kOutside - 1), outside_mm[1]);
}

BallContact press_ball(double ball_radius_mm, double contact_radius_mm, double thickness_mm) {
  const double a = contact_radius_mm;
  const double thickness = thickness_mm / a;  // contact radii
  if (!(a > 0 && a <= kWidestContact * ball_radius_mm && thickness >= kMinGelThicknessMm &&
        thickness <= kMaxGelThicknessMm)) {
    throw std::invalid_argument(fmt::format(
        "no contact {} mm wide of a ball of radius {} mm on a gel of {} mm can be computed", 2 * a,
        ball_radius_mm, thickness_mm));
  }
  const Matrices& m = matrices();
  Eigen::Index count = 0;
  while (count < m.kappa.size() && m.kappa[count] * thickness < kNoGelLeft) ++count;
  Eigen::VectorXd gel(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    gel[i] = m.weight[i] * layer_minus_half_space(m.kappa[i] * thickness);
  }
  const Eigen::MatrixXd answered = gel.asDiagonal() * m.transform.topRows(count);

  // Unknowns: the pressures in units of E/(3/2·a), and the depth; one row a knot, edge included.
  Eigen::MatrixXd equations(kHats + 1, kHats + 1);
  equations.leftCols(kHats) = m.half_inside + m.inside.topRows(count).transpose() * answered;
  equations.col(kHats).setConstant(-1);
  Eigen::VectorXd sags(kHats + 1);
  for (Eigen::Index i = 0; i <= kHats; ++i) sags[i] = -sag(ball_radius_mm, a * knot(i));
  const Eigen::VectorXd solution = equations.partialPivLu().solve(sags);
  const auto pressure = solution.head(kHats);

  BallContact contact{ball_radius_mm, a, solution[kHats], {}};
  const Eigen::VectorXd outside =
      m.half_outside * pressure + m.outside.topRows(count).transpose() * (answered * pressure);
  contact.outside_mm.assign(outside.begin(), outside.end());
  return contact;
}

BallContact press_ball_to(double ball_radius_mm, double depth_mm, double thickness_mm) {
  const double least = 1.001 * thickness_mm / kMaxGelThicknessMm;
  const double most =
      0.999 * std::min(kWidestContact * ball_radius_mm, thickness_mm / kMinGelThicknessMm);
  // About as wide as the circle that the undeformed surface cuts out of the ball. Depth grows with
  // the square of the radius, less on a thin gel, so each step leaves a part of the error.
  double radius = std::sqrt(depth_mm * std::max(0.0, 2 * ball_radius_mm - depth_mm));
  for (int i = 0;; ++i) {
    radius = std::clamp(radius, least, most);
    BallContact contact = press_ball(ball_radius_mm, radius, thickness_mm);
    const bool stuck = (radius == most && contact.depth_mm < depth_mm) ||
                       (radius == least && contact.depth_mm > depth_mm);
    if (i == 30 || stuck || std::abs(contact.depth_mm - depth_mm) < 1e-4) return contact;
    radius *= std::sqrt(depth_mm / contact.depth_mm);
  }
}

}  // namespace dtact::calibration
