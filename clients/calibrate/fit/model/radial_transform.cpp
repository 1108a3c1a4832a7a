#include "clients/calibrate/fit/model/radial_transform.hpp"

#include <math.h>  // ::j0: the C++ Bessel functions are ten times slower

#include <vector>

namespace dtact::calibration {
namespace {

constexpr double kLastWaveNumber = 26;  // 1/mm
/// J₀ at 14 mm turns half a time a panel.
constexpr double kPanel = 0.25;

}  // namespace

const RadialTransform& RadialTransform::instance() {
  static const RadialTransform made;
  return made;
}

RadialTransform::RadialTransform() {
  std::vector<double> nodes;
  std::vector<double> weights;
  for (int panel = 0; panel * kPanel < kLastWaveNumber; ++panel) {
    const double from = panel * kPanel;
    for_gauss_points(from, from + kPanel, [&](double k, double w) {
      nodes.push_back(k);
      weights.push_back(w);
    });
  }
  const auto count = static_cast<Eigen::Index>(nodes.size());
  k_ = Eigen::Map<Eigen::VectorXd>(nodes.data(), count);
  weights_ = Eigen::Map<Eigen::VectorXd>(weights.data(), count);
  forward_.setZero(count, kPoints);
  for (Eigen::Index n = 0; n < count; ++n) {
    for (Eigen::Index i = 0; i + 1 < kPoints; ++i) {
      const double from = kStepMm * static_cast<double>(i);
      for_gauss_points(from, from + kStepMm, [&](double r, double weight) {
        const double share = (r - from) / kStepMm;
        const double value = weight * r * ::j0(k_[n] * r);
        forward_(n, i) += (1 - share) * value;
        forward_(n, i + 1) += share * value;
      });
    }
  }
  std::vector<double> places(static_cast<std::size_t>(kPoints));
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = kStepMm * static_cast<double>(i);
  back_ = back_to(places);
}

Eigen::MatrixXd RadialTransform::back_to(std::span<const double> places_mm) const {
  Eigen::MatrixXd back(static_cast<Eigen::Index>(places_mm.size()), k_.size());
  for (Eigen::Index n = 0; n < k_.size(); ++n) {
    for (Eigen::Index i = 0; i < back.rows(); ++i) {
      back(i, n) = weights_[n] * k_[n] * ::j0(k_[n] * places_mm[static_cast<std::size_t>(i)]);
    }
  }
  return back;
}

}  // namespace dtact::calibration
