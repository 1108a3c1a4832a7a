#include "clients/calibrate/fit/model/gel_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

TEST(RadialTransform, BlursAGaussianIntoAWiderOne) {
  // Two Gaussians of variances s² and t² make one of s² + t², lower by s²/(s² + t²) in two
  // dimensions.
  const RadialTransform& radial = RadialTransform::instance();
  Eigen::VectorXd values(RadialTransform::kPoints);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double r = RadialTransform::kStepMm * static_cast<double>(i);
    values[i] = std::exp(-r * r / (2 * 0.64));
  }
  const Eigen::VectorXd blur = radial.values(radial.transform(values).cwiseProduct(blurred(0.6)));
  for (Eigen::Index i = 0; i < values.size(); i += 10) {
    const double r = RadialTransform::kStepMm * static_cast<double>(i);
    EXPECT_NEAR(blur[i], 0.64 * std::exp(-r * r / 2), 2e-4) << r;
  }
}

TEST(RadialTransform, KeepsWhatIsSmooth) {
  const RadialTransform& radial = RadialTransform::instance();
  Eigen::VectorXd values(RadialTransform::kPoints);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double r = RadialTransform::kStepMm * static_cast<double>(i);
    values[i] = std::cos(r) * std::exp(-r * r / 8);
  }
  const Eigen::VectorXd back = radial.values(radial.transform(values));
  EXPECT_LT((back - values).cwiseAbs().maxCoeff(), 3e-4);
}

TEST(Response, IntegratesItsSlope) {
  // The slope rises from 0.4 at zero to 0.8 at 0.4 and stays; below zero it is 1.2, and 2 below
  // −0.12.
  const Response response{.slopes = {2, 2, 0.4, 0.8, 0.8}, .bulge_factor = 1};
  EXPECT_EQ(response.loss(0), 0);
  EXPECT_NEAR(response.loss(0.4), 0.24, 1e-12);
  EXPECT_NEAR(response.loss(0.2), 0.1, 1e-12);
  EXPECT_NEAR(response.loss(1), 0.72, 1e-12);
  EXPECT_NEAR(response.loss(-0.12), -0.144, 1e-12);
  EXPECT_NEAR(response.loss(-0.3), -0.504, 1e-12);
  const Response kinked{.slopes = {2, 2, 0.4, 0.8, 0.8}, .bulge_factor = 1.5};
  EXPECT_NEAR(kinked.loss(-0.12), -0.216, 1e-12);
  EXPECT_NEAR(kinked.loss(0.2), 0.1, 1e-12);
}

TEST(Filter, TakesScatteringBackStepByStep) {
  // A wave that scattering halves shows as 1/2; the filter's steps bring it to
  // 1/2·(1 + 1/2) and 1/2·(1 + 1/2 + 1/4).
  const Eigen::VectorXd half = Eigen::VectorXd::Constant(1, 0.5);
  EXPECT_NEAR(sharpened(half, 0)[0], 1, 1e-12);
  EXPECT_NEAR(sharpened(half, 1)[0], 1.5, 1e-12);
  EXPECT_NEAR(sharpened(half, 2)[0], 1.75, 1e-12);
}

}  // namespace
}  // namespace dtact::calibration
