#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <span>

namespace dtact::calibration {

// Piecewise linear functions through equally spaced knots, fitted by least squares with a penalty
// on their bends.

/// The two knots around a position that is counted in knots from the first; positions outside
/// belong to the outermost pair.
struct BetweenKnots {
  Eigen::Index below = 0;
  double part = 0;  ///< Part of the way to the next knot; outside of 0 … 1 beyond the knots.
};
[[nodiscard]] BetweenKnots between_knots(double place, Eigen::Index knots);

/// The function's value; beyond the knots along the outermost two. At least two knots.
[[nodiscard]] double value_at(const Eigen::VectorXd& knots, double place);

/// A linear least-squares problem as its normal equations.
class LeastSquares {
 public:
  explicit LeastSquares(Eigen::Index unknowns);

  struct Term {
    Eigen::Index unknown = 0;
    double factor = 0;
  };
  /// Adds the equation Σ factor · unknown = value.
  void add(std::span<const Term> terms, double value, double weight);
  void add(std::initializer_list<Term> terms, double value, double weight) {
    add(std::span(terms.begin(), terms.size()), value, weight);
  }
  /// Penalises each bend of the function whose knots are the unknowns first … first + count − 1.
  void straighten(Eigen::Index first, Eigen::Index count, double weight);

  /// Sum of the equations' weights times their squared factors.
  [[nodiscard]] double trace() const { return matrix_.trace(); }
  /// The smallest solution where the equations do not determine one.
  [[nodiscard]] Eigen::VectorXd solve() const;

 private:
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd right_;
};

}  // namespace dtact::calibration
