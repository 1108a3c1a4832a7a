// The fit and its LUTs on presses that the model itself computes, so that the truth is known.
// tests/accuracy/model fits sensors of another simulator.
#include "clients/calibrate/fit/model/model_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/model/model_lut.hpp"
#include "clients/calibrate/fit/model/radial_transform.hpp"

namespace dtact::calibration {
namespace {

constexpr double kLight = 160;      // grey levels
constexpr double kSmoothing = 0.1;  // mm

GelModel gel() {
  return {.thickness_mm = 2.2,
          .response = {.slopes = {1.6, 1.1, 0.42, 0.4, 0.36}, .bulge_factor = 1},
          .scattering = {0.28, 1.3, 0.72}};
}

Eigen::VectorXd levels(const BallContact& contact, int steps) {
  const GelModel made = gel();
  const Eigen::VectorXd scattering = scattered(made.scattering);
  return kLight *
         RadialTransform::instance().values(predict_press(made, contact)
                                                .spectrum.cwiseProduct(scattering)
                                                .cwiseProduct(blurred(kSmoothing))
                                                .cwiseProduct(sharpened(scattering, steps)));
}

double lut_mm(const recon::DepthLut& lut, double level) {
  return 0.001 * lut.um[static_cast<std::size_t>(std::lround(64 * level) - lut.first_q6)];
}

TEST(ModelFit, FindsTheGelThatMadeAPress) {
  const BallContact contact = press_ball(4, 2.8, 2.2);
  const Eigen::VectorXd seen = levels(contact, 0);
  PressProfile press;
  press.ball_radius_mm = 4;
  press.contact_radius_mm = 3.1;  // as a circle of three grey levels has it
  press.smoothing_mm = kSmoothing;
  for (Eigen::Index i = 1; i < 300; i += 3) {
    press.radius_mm.push_back(RadialTransform::kStepMm * static_cast<double>(i));
    press.loss.push_back(seen[i] / kLight + 0.003);
    press.noise.push_back(1e-4);
  }
  const ModelFit fit = fit_model({&press, 1});
  EXPECT_NEAR(fit.gel.thickness_mm, 2.2, 0.06);
  EXPECT_NEAR(fit.gel.scattering.narrow_mm, 0.28, 0.03);
  EXPECT_NEAR(fit.gel.scattering.wide_mm, 1.3, 0.15);
  EXPECT_NEAR(fit.deepest_mm(), contact.depth_mm, 0.015);
  EXPECT_NEAR(fit.presses[0].offset, 0.003, 5e-4);
  EXPECT_LT(fit.residual * kLight, 0.03);
  // The truth lies within what the covariance allows.
  const double thickness_error = std::sqrt(fit.covariance(0, 0));
  EXPECT_GT(thickness_error, 1e-4);
  EXPECT_LT(std::abs(std::log(fit.gel.thickness_mm / 2.2)), 3 * thickness_error);
}

// Nothing but noise: the thickness stays 2 mm ± 35 %, the widths ± 50 % and the kink ± 30 %.
TEST(ModelFit, PressesThatShowNothingLeaveThePriors) {
  std::vector<PressProfile> presses;
  for (const double radius_mm : {2.8, 2.1}) {
    const Eigen::VectorXd seen = levels(press_ball(4, radius_mm, 2.2), 0);
    PressProfile& press = presses.emplace_back();
    press.ball_radius_mm = 4;
    press.contact_radius_mm = radius_mm;
    press.smoothing_mm = kSmoothing;
    for (Eigen::Index i = 1; i < 300; i += 6) {
      press.radius_mm.push_back(RadialTransform::kStepMm * static_cast<double>(i));
      press.loss.push_back(seen[i] / kLight);
      press.noise.push_back(10);  // times the light
    }
  }
  const ModelFit fit = fit_model(presses);
  for (const auto& [parameter, deviation] : {std::pair{ModelFit::kThickness, 0.35},
                                             {ModelFit::kNarrow, 0.5},
                                             {ModelFit::kWide, 0.5},
                                             {ModelFit::kBulge, 0.3}}) {
    EXPECT_NEAR(std::sqrt(fit.covariance(parameter, parameter)), deviation, 0.02 * deviation);
  }
  EXPECT_NEAR(fit.covariance(ModelFit::kThickness, ModelFit::kWide), 0, 0.002);
}

/// A map of a press that is darker on one side and across, about (120, 118).
DarkeningMap lopsided(const Eigen::VectorXd& seen) {
  DarkeningMap map{240, 240, 0.08, {}};
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double right = map.mm_per_px * (x - 120);
      const double down = map.mm_per_px * (y - 118);
      const double r = std::hypot(right, down);
      const auto place =
          std::min<Eigen::Index>(seen.size() - 1, std::lround(r / RadialTransform::kStepMm));
      const double held = std::min(1.0, 2.8 / std::max(1e-9, r));
      const double gain =
          1 + 0.04 * held * right + 0.03 * held * held * (right * right - down * down);
      map.levels.push_back(static_cast<float>(seen[place] / gain));
    }
  }
  return map;
}

TEST(ModelFit, LooksAtALopsidedPressAboutItsMiddle) {
  const BallContact pressed = press_ball(4, 2.8, 2.2);
  const DarkeningMap map = lopsided(levels(pressed, 0));
  const Contact contact = find_contact(map, 4);
  const ChosenAsymmetry chosen = choose_asymmetry(sure_samples(map, contact), 4);
  ASSERT_EQ(chosen.gain.order, AsymmetryOrder::quadratic);
  const auto depth_of = [&](const PressAsymmetry& gain) {
    const PressProfile profile =
        profile_of(without_asymmetry(map, contact, gain), kLight, kSmoothing);
    return fit_model({&profile, 1}).deepest_mm();
  };
  const double off = std::abs(depth_of(chosen.gain) - pressed.depth_mm);
  EXPECT_LT(off, 0.04);
  EXPECT_LT(off, std::abs(depth_of({}) - pressed.depth_mm));
}

TEST(ModelLutTest, ReadsABallThroughEveryFilter) {
  const MapOptics optics{kLight, kSmoothing, 0.04};
  const auto luts = luts_of(gel(), optics, 1.5);
  const BallContact contact = press_ball_to(5, 1, 2.2);
  // Each step of the filter reduces the influence of an object's shape on its reading.
  const std::vector<double> allowed = {0.03, 0.02, 0.015};
  for (int steps = 0; steps < kLuts; ++steps) {
    const recon::DepthLut& lut = luts[static_cast<std::size_t>(steps)];
    EXPECT_EQ(lut_mm(lut, 0), 0) << steps;
    EXPECT_NO_THROW(recon::check(lut, true)) << steps;
    EXPECT_NEAR(lut_mm(lut, lut.covered_to_q6 / 64.0), 1.5, 0.15) << steps;
    const Eigen::VectorXd seen = levels(contact, steps);
    double sum = 0;
    double area = 0;
    for (Eigen::Index i = 0;
         RadialTransform::kStepMm * static_cast<double>(i) < contact.contact_radius_mm; ++i) {
      const double r = RadialTransform::kStepMm * static_cast<double>(i);
      sum += r * std::abs(lut_mm(lut, seen[i]) - contact.indentation_mm(r));
      area += r;
    }
    EXPECT_LT(sum / area, allowed[static_cast<std::size_t>(steps)]) << steps;
  }
}

// Also on gels that scatter much and whose bulge brightens so steeply that its light reaches far
// into the contact.
TEST(ModelLutTest, NoDarkeningIsNoIndentation) {
  GelModel bright = gel();
  for (const double weight : {0.1, 0.25, 0.5}) {
    for (const double bulge : {2.0, 5.0, 9.0}) {
      bright.scattering = {0.28, 1.3, weight};
      bright.response.bulge_factor = bulge;
      for (const recon::DepthLut& lut : luts_of(bright, {kLight, kSmoothing, 0.04}, 1.2)) {
        EXPECT_EQ(lut_mm(lut, 0), 0) << weight << ", " << bulge;
        EXPECT_NO_THROW(recon::check(lut, true));
      }
    }
  }
}

}  // namespace
}  // namespace dtact::calibration
