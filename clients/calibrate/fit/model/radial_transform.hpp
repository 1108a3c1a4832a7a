#pragma once

#include <Eigen/Core>
#include <span>

namespace dtact::calibration {

/// Functions of the distance from an axis, from 0 to 14 mm, and their Hankel transforms, in which a
/// blur is a product. Between the grid's points a function is a straight line; beyond the last it
/// is nothing. Wave numbers reach so far that a blur of 0.15 mm and more is complete to 1e-3 of a
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
  /// Back, to the same places.
  [[nodiscard]] Eigen::VectorXd values(const Eigen::VectorXd& spectrum) const {
    return back_ * spectrum;
  }
  /// The matrix that takes a spectrum back to other places, millimetres.
  [[nodiscard]] Eigen::MatrixXd back_to(std::span<const double> places_mm) const;

 private:
  RadialTransform();

  Eigen::VectorXd k_;
  Eigen::VectorXd weights_;  ///< Of the quadrature over wave numbers.
  Eigen::MatrixXd forward_;
  Eigen::MatrixXd back_;
};

}  // namespace dtact::calibration
