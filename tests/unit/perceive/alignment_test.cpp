#include "clients/perceive/pose/alignment.hpp"

#include <gtest/gtest.h>

#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using namespace test;
using Eigen::Vector3d;

std::vector<Twist> unobservable_of(const Alignment& found) {
  return perceive::unobservable_of(found.covariance, found.centre, found.arm);
}

Alignment align_to(const Balls& object, const Motion& motion, double noise_um = 0,
                   const recon::Surface& surface = {}) {
  const Frame before(object, Motion::Identity(), noise_um, 1, surface);
  const Frame after(object, motion, noise_um, 2, surface);
  return align(before.view().surfels(1500), after.view(), Motion::Identity());
}

TEST(Align, NothingMoved) {
  const Alignment found = align_to(bumps(), Motion::Identity());
  EXPECT_TRUE(unobservable_of(found).empty());
  EXPECT_GT(found.overlap, 0.8);
  EXPECT_LT(error_of(found, Motion::Identity()).um, 0.1);
}

TEST(Align, FindsASlideATurnATiltAndAPress) {
  for (const Motion& motion :
       {moved({0.15, -0.1, 0}), moved({0, 0, 0}, Vector3d::UnitZ(), 4), moved({0, 0, -0.08}),
        moved({0, 0, 0}, {1, 0.5, 0}, 2), moved({0.1, 0.05, -0.03}, {0.3, -0.2, 1}, 3)}) {
    const Alignment found = align_to(bumps(), motion);
    EXPECT_TRUE(unobservable_of(found).empty());
    EXPECT_LT(error_of(found, motion).degrees, 0.1);
    EXPECT_LT(error_of(found, motion).um, 6);
  }
}

TEST(Align, NoiseOfTenMicrometres) {
  const Motion motion = moved({0.1, 0.05, -0.03}, {0.3, -0.2, 1}, 3);
  const Alignment found = align_to(bumps(), motion, 10);
  EXPECT_LT(error_of(found, motion).degrees, 0.5);
  EXPECT_LT(error_of(found, motion).um, 10);
}

TEST(Align, ABallDoesNotShowItsRotationAndDoesNotRoll) {
  const Balls ball{{{{0, 0, 3.0}, 4.0}}};
  const Motion motion = moved({0.2, -0.1, -0.05});
  for (const double noise_um : {0.0, 5.0}) {
    const Alignment found = align_to(ball, motion, noise_um);
    ASSERT_EQ(unobservable_of(found).size(), 3U);
    EXPECT_LT(error_of(found, motion).um, 6);
    // No rotation: the whole slide is found, though part of it might have been a roll.
    EXPECT_LT(Eigen::AngleAxisd(found.motion.linear()).angle(), 0.002);
    EXPECT_LT((found.motion.translation() - motion.translation()).norm(), 1e-5);
  }
}

TEST(Align, OnCurvedSurfacesToo) {
  for (const recon::Surface& surface : curved()) {
    for (const Motion& motion :
         {moved({0.15, -0.1, 0}), moved({0, 0, 0}, Vector3d::UnitZ(), 4), moved({0, 0, -0.08}),
          moved({0, 0, 0}, {1, 0.5, 0}, 2), moved({0.1, 0.05, -0.03}, {0.3, -0.2, 1}, 3)}) {
      const Alignment found = align_to(bumps(), motion, 0, surface);
      EXPECT_TRUE(unobservable_of(found).empty());
      EXPECT_LT(error_of(found, motion).degrees, 0.1);
      EXPECT_LT(error_of(found, motion).um, 6);
    }
  }
}

TEST(Align, ABallOnTheSideOfAFingerDoesNotShowItsRotation) {
  for (const recon::Surface& surface : curved()) {
    const Vector3d centre(0, 0, -surface.radius_mm);
    const Vector3d middle =
        centre + (surface.radius_mm + 3.2) * Vector3d(0.1, 0.12, 1).normalized();
    const Balls ball{{{middle, 4.0}}};
    const Motion motion = moved({0.2, -0.1, -0.05});
    for (const double noise_um : {0.0, 5.0}) {
      const Alignment found = align_to(ball, motion, noise_um, surface);
      ASSERT_EQ(unobservable_of(found).size(), 3U);
      EXPECT_LT(error_of(found, motion).um, 6);
      const Eigen::AngleAxisd turn(found.motion.linear());
      EXPECT_LT(turn.angle(), 0.002);
      const Vector3d moved_by = 1e3 * (found.motion * (1e-3 * middle)) - middle;
      EXPECT_LT((moved_by - Vector3d(0.2, -0.1, -0.05)).norm(), 0.01);
    }
  }
}

// From 0.3 mm on a surfel has no weight. The mean over no distances is not a number, and is not
// reported.
TEST(Align, WhatIsTooFarAwayCountsForNothing) {
  const Frame deep([](const SurfacePoint&) { return 1.0; });
  const Frame light([](const SurfacePoint&) { return 0.4; });
  const Alignment found = align(deep.view().surfels(1500), light.view(), Motion::Identity());
  EXPECT_GT(found.arm, 1e-3) << "surfels were compared";
  EXPECT_EQ(found.points, 0U);
  EXPECT_EQ(found.overlap, 0);
  EXPECT_EQ(found.fit, 0);
  EXPECT_EQ(found.rms, 0);
  EXPECT_TRUE(found.motion.isApprox(Motion::Identity()));
}

TEST(Align, APlateDoesNotShowItsSlidingNorItsTurning) {
  // A ball of ten metres: flat over the map.
  const Balls plate{{{{0, 0, 9999.5}, 10000}}};
  const Motion motion = moved({0.2, -0.1, -0.1});
  for (const double noise_um : {0.0, 5.0}) {
    const Alignment found = align_to(plate, motion, noise_um);
    ASSERT_EQ(unobservable_of(found).size(), 3U);
    EXPECT_LT(error_of(found, motion).um, 3);
    EXPECT_NEAR(found.motion.translation().z(), -1e-4, 3e-6);
    EXPECT_LT(found.motion.translation().head<2>().norm(), 1e-6) << "not filled with noise";
  }
}

}  // namespace
}  // namespace dtact::perceive
