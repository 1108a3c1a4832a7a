#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>

namespace dtact::calibration {

/// Six-point Gauss-Legendre quadrature on [-1, 1], exact for polynomials of degree 11 (Abramowitz
/// and Stegun 1964, table 25.4).
inline constexpr std::array<double, 6> kGaussNodes = {-0.932469514203152, -0.661209386466265,
                                                      -0.238619186083197, 0.238619186083197,
                                                      0.661209386466265,  0.932469514203152};
inline constexpr std::array<double, 6> kGaussWeights = {0.171324492379170, 0.360761573048139,
                                                        0.467913934572691, 0.467913934572691,
                                                        0.360761573048139, 0.171324492379170};

/// Calls `add(place, weight)` for the six points of [from, to].
template <typename Add>
void for_gauss_points(double from, double to, const Add& add) {
  const double half = 0.5 * (to - from);
  for (std::size_t i = 0; i < kGaussNodes.size(); ++i) {
    add(from + half * (1 + kGaussNodes[i]), half * kGaussWeights[i]);
  }
}

/// Functions of the distance from an axis, from 0 to 14 mm, and their Hankel transforms, in which a
/// blur is a product. Between the grid's points a function is a straight line; beyond the last it
/// is zero. The range of wave numbers represents a blur of at least 0.15 mm to within 1e-3 of a
/// step's height.
class RadialTransform {
 public:
  static constexpr double kStepMm = 0.03;
  static constexpr Eigen::Index kPoints = 467;
  static constexpr double kReachMm = kStepMm * (kPoints - 1);

  /// The one instance: 5 MB of matrices, made on first use.
  [[nodiscard]] static const RadialTransform& instance();

  /// Wave numbers, 1/mm, ascending.
  [[nodiscard]] const Eigen::VectorXd& wave_numbers() const noexcept { return k_; }
  /// ∫ f(r)·J₀(kr)·r dr of values at i·kStepMm.
  [[nodiscard]] Eigen::VectorXd transform(const Eigen::VectorXd& values) const {
    return forward_ * values;
  }
  /// The inverse, at the same positions.
  [[nodiscard]] Eigen::VectorXd values(const Eigen::VectorXd& spectrum) const {
    return back_ * spectrum;
  }
  /// The matrix that transforms a spectrum to other positions, millimetres.
  [[nodiscard]] Eigen::MatrixXd back_to(std::span<const double> places_mm) const;

 private:
  RadialTransform();

  Eigen::VectorXd k_;
  Eigen::VectorXd weights_;  ///< Quadrature over wave numbers.
  Eigen::MatrixXd forward_;
  Eigen::MatrixXd back_;
};

}  // namespace dtact::calibration
