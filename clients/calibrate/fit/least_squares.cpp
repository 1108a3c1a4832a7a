#include "clients/calibrate/fit/least_squares.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace dtact::calibration {

BetweenKnots between_knots(double place, Eigen::Index knots) {
  const auto below =
      std::clamp<Eigen::Index>(static_cast<Eigen::Index>(std::floor(place)), 0, knots - 2);
  return {below, place - static_cast<double>(below)};
}

double value_at(const Eigen::VectorXd& knots, double place) {
  const auto [below, part] = between_knots(place, knots.size());
  return std::lerp(knots[below], knots[below + 1], part);
}

LeastSquares::LeastSquares(Eigen::Index unknowns)
    : matrix_(Eigen::MatrixXd::Zero(unknowns, unknowns)), right_(Eigen::VectorXd::Zero(unknowns)) {}

void LeastSquares::add(std::span<const Term> terms, double value, double weight) {
  for (const Term& a : terms) {
    if (a.factor == 0) continue;
    right_[a.unknown] += weight * a.factor * value;
    for (const Term& b : terms) matrix_(a.unknown, b.unknown) += weight * a.factor * b.factor;
  }
}

void LeastSquares::straighten(Eigen::Index first, Eigen::Index count, double weight) {
  for (Eigen::Index k = first; k + 2 < first + count; ++k) {
    add({{k, 1}, {k + 1, -2}, {k + 2, 1}}, 0, weight);
  }
}

Eigen::VectorXd LeastSquares::solve() const {
  constexpr double kSingular = 1e-14;
  const Eigen::LLT<Eigen::MatrixXd> factors(matrix_);
  if (factors.info() == Eigen::Success && factors.rcond() > kSingular) {
    return factors.solve(right_);
  }
  return matrix_.completeOrthogonalDecomposition().solve(right_);
}

}  // namespace dtact::calibration
