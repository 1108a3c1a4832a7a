// The axisymmetric contact against the literature, and against the simulator's solver, which shares
// only the gel's compliance with it: two dimensions, FFT, unknown contact region.
#include "clients/calibrate/fit/model/ball_contact.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "hal/sim/elastic_layer.hpp"

namespace dtact::calibration {
namespace {

TEST(BallContact, OnAThickGelIsHertz) {
  // K. L. Johnson, Contact Mechanics, eq. 4.22 and 3.42a: depth a²/R; outside the contact
  // ((2a² − r²) asin(a/r) + r²√(1 − a²/r²)·a/r) / πR. The sphere's sag is r²/2R + r⁴/8R³ …
  const BallContact contact = press_ball(50, 1, 11.9);
  // The bonded gel is stiffer than a half-space by the first order in a/h, so not exactly.
  EXPECT_NEAR(contact.depth_mm, 1.0 / 50, 0.1 / 50);
  const double rise_at_edge = contact.depth_mm - contact.indentation_mm(1);
  EXPECT_NEAR(rise_at_edge, 0.5 / 50, 1e-5);
  const double u =
      (0.5 * std::asin(1 / 1.5) * (2 - 2.25) * 2 + 2.25 * std::sqrt(1 - 1 / 2.25) / 1.5) /
      (std::numbers::pi * 50);
  const double u_at_edge = 0.5 / 50;
  EXPECT_NEAR(contact.indentation_mm(1) - contact.indentation_mm(1.5), u_at_edge - u, 2e-4);
}

TEST(BallContact, ConservesTheGelsVolume) {
  for (const double thickness : {1.0, 2.0, 3.0}) {
    const BallContact contact = press_ball(4, 2.5, thickness);
    double volume = 0;
    double moved = 0;
    for (double r = 0.005; r < 30; r += 0.01) {
      const double u = contact.indentation_mm(r);
      volume += u * 2 * std::numbers::pi * r * 0.01;
      moved += std::abs(u) * 2 * std::numbers::pi * r * 0.01;
    }
    EXPECT_NEAR(volume / moved, 0, 0.005) << thickness;
  }
}

TEST(BallContact, IsContinuousAtTheEdge) {
  const BallContact contact = press_ball(4, 2.5, 2);
  EXPECT_NEAR(contact.indentation_mm(2.5 - 1e-6), contact.indentation_mm(2.5 + 1e-6), 1e-5);
}

TEST(BallContact, AgreesWithTheTwoDimensionalSolver) {
  constexpr int kSize = 320;
  constexpr double kSpacing = 0.1;
  for (const double thickness : {1.5, 3.0}) {
    const double depth = 0.5 * thickness;
    cv::Mat1d target(kSize, kSize, -1e3);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const double r = std::hypot(x - kSize / 2, y - kSize / 2) * kSpacing;
        if (r < 3.9) target(y, x) = depth - 4 + std::sqrt(16 - r * r);
      }
    }
    const hal::sim::ElasticLayer gel(kSize, kSize, kSpacing, thickness);
    const cv::Mat1d truth = gel.solve(target, {}).indentation_mm;
    const BallContact contact = press_ball_to(4, depth, thickness);
    EXPECT_NEAR(contact.depth_mm, depth, 2e-4);
    for (int i = 0; i < 70; ++i) {
      EXPECT_NEAR(contact.indentation_mm(i * kSpacing), truth(kSize / 2, kSize / 2 + i),
                  2e-3)  // the kink between the grid's points
          << thickness << " at " << i * kSpacing << " mm, contact " << contact.contact_radius_mm;
    }
  }
}

TEST(BallContact, RefusesWhatItWasNotLaidOutFor) {
  EXPECT_THROW((void)press_ball(4, 3.95, 2), std::invalid_argument);
  EXPECT_THROW((void)press_ball(4, 2, 0.1), std::invalid_argument);
  EXPECT_THROW((void)press_ball(4, 0, 2), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::calibration
