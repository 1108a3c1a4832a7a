#include "clients/calibrate/fit/model/radial_transform.hpp"

#include <math.h>  // ::j0: the C++ Bessel functions are ten times slower

#include <vector>

#include "clients/calibrate/fit/model/gauss_legendre.hpp"

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
  for (double from = 0; from < kLastWaveNumber; from += kPanel) {
    for_gauss_points(from, from + kPanel, [&](double k, double w) {
      nodes.push_back(k);
      weights.push_back(w);
    });
  }
  const auto count = static_cast<Eigen::Index>(nodes.size());
  k_ = Eigen::Map<Eigen::VectorXd>(nodes.data(), count);
  forward_.setZero(count, kPoints);
  back_.resize(kPoints, count);
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
    for (Eigen::Index i = 0; i < kPoints; ++i) {
      back_(i, n) = weights[static_cast<std::size_t>(n)] * k_[n] *
                    ::j0(k_[n] * kStepMm * static_cast<double>(i));
    }
  }
}

}  // namespace dtact::calibration
