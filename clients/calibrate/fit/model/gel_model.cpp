#include "clients/calibrate/fit/model/gel_model.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

Eigen::ArrayXd gaussian(double sigma_mm) {
  return (-0.5 * sigma_mm * sigma_mm * RadialTransform::instance().wave_numbers().array().square())
      .exp();
}

}  // namespace

double Response::loss(double indentation) const {
  // ∫ of the slope from zero outwards, knot by knot.
  const bool pressed = indentation >= 0;
  const std::ptrdiff_t step = pressed ? 1 : -1;
  const std::ptrdiff_t end = pressed ? static_cast<std::ptrdiff_t>(kKnots.size()) - 1 : 0;
  const double factor = pressed ? 1 : bulge_factor;
  const auto knot = [](std::ptrdiff_t i) { return kKnots[static_cast<std::size_t>(i)]; };
  const auto slope = [&](std::ptrdiff_t i) { return factor * slopes[static_cast<std::size_t>(i)]; };
  double sum = 0;
  std::ptrdiff_t i = 2;  // the knot at zero
  for (; i != end; i += step) {
    const double length = knot(i + step) - knot(i);
    const double part = std::min(1.0, (indentation - knot(i)) / length);
    sum += part * length * (slope(i) + 0.5 * part * (slope(i + step) - slope(i)));
    if (part < 1) return sum;
  }
  return sum + slope(end) * (indentation - knot(end));
}

PredictedPress predict_press(const GelModel& gel, const BallContact& contact) {
  const RadialTransform& radial = RadialTransform::instance();
  PredictedPress press;
  press.indentation_mm.resize(RadialTransform::kPoints);
  Eigen::VectorXd loss(RadialTransform::kPoints);
  for (Eigen::Index i = 0; i < RadialTransform::kPoints; ++i) {
    press.indentation_mm[i] =
        contact.indentation_mm(RadialTransform::kStepMm * static_cast<double>(i));
    loss[i] = gel.response.loss(press.indentation_mm[i] / gel.thickness_mm);
  }
  press.spectrum = radial.transform(loss);
  return press;
}

Eigen::VectorXd scattered(const recon::Scattering& scattering) {
  return scattering.narrow_weight * gaussian(scattering.narrow_mm) +
         (1 - scattering.narrow_weight) * gaussian(scattering.wide_mm);
}

Eigen::VectorXd blurred(double sigma_mm) { return gaussian(sigma_mm); }

Eigen::VectorXd sharpened(const Eigen::VectorXd& scattering, int steps) {
  Eigen::ArrayXd sum = Eigen::ArrayXd::Ones(scattering.size());
  for (int i = 0; i < steps; ++i) sum = 1 + (1 - scattering.array()) * sum;
  return sum;
}

}  // namespace dtact::calibration
