#include "clients/perceive/geometry/surface_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "clients/perceive/geometry/height_map.hpp"
#include "tests/unit/perceive/sampled.hpp"

namespace dtact::perceive {
namespace {

using Kind = recon::Surface::Kind;

void expect_near(const Vector& actual, const Vector& expected, double tolerance) {
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(actual[i], expected[i], tolerance) << "axis " << i;
}

TEST(CastRay, APlaneIsTheMapItself) {
  const auto found = cast_ray({}, 3, -2);
  ASSERT_TRUE(found.has_value());
  expect_near(found->point, {3e-3, -2e-3, 0}, 1e-15);
  expect_near(found->normal, {0, 0, 1}, 0);
}

TEST(CastRay, TheAxisLeavesASphereAtTheOrigin) {
  const auto found = cast_ray({Kind::sphere, 12, 0, 20, 8, 1.41}, 0, 0);
  ASSERT_TRUE(found.has_value());
  expect_near(found->point, {0, 0, 0}, 1e-12);
  expect_near(found->normal, {0, 0, 1}, 1e-12);
}

// With no refraction the camera, at (0, 0, −25), sees (3, 0, 0) along a straight line: from it by
// t · (3, 0, 25). On the sphere of 10 mm about (0, 0, −10): 634 t² − 750 t + 125 = 0,
// t = (375 + √(375² − 634 · 125)) / 634 = 0.98224 …
TEST(CastRay, WithoutRefractionItIsAStraightLine) {
  const auto found = cast_ray({Kind::sphere, 10, 0, 20, 5, 1}, 3, 0);
  ASSERT_TRUE(found.has_value());
  const double t = (375 + std::sqrt(375.0 * 375 - 634 * 125.0)) / 634;
  EXPECT_NEAR(t, 0.98224, 1e-5);
  expect_near(found->point, {3e-3 * t, 0, 25e-3 * (t - 1)}, 1e-12);
  expect_near(found->normal, {0.3 * t, 0, 2.5 * (t - 1) + 1}, 1e-12);
}

// Chosen backwards: in the gel (index 1.5) the ray climbs 4 mm in 3 (sin = 0.6 would be 0.9 in the
// air, tan 0.9 / √0.19); it enters at 2 mm and crosses z = 0, 4 mm on, at 5 mm.
TEST(CastRay, SnellsLaw) {
  const double air_mm = 2 * std::sqrt(0.19) / 0.9;
  const auto found = cast_ray({Kind::cylinder, 50, 90, air_mm, 4, 1.5}, 5, 0);
  ASSERT_TRUE(found.has_value());
  // The point lies on that ray and on the cylinder about y.
  EXPECT_NEAR((found->point[0] - 2e-3) / (found->point[2] + 4e-3), 0.75, 1e-9);
  EXPECT_NEAR(std::hypot(found->point[0], found->point[2] + 50e-3), 50e-3, 1e-12);
  EXPECT_EQ(found->point[1], 0);
}

TEST(CastRay, ACylinderIsStraightAlongItsAxis) {
  const recon::Surface finger{Kind::cylinder, 9, 0, 15, 6, 1.41};
  const auto found = cast_ray(finger, 4, 0);
  ASSERT_TRUE(found.has_value());
  expect_near(found->point, {4e-3, 0, 0}, 1e-12);
  expect_near(found->normal, {0, 0, 1}, 1e-12);
  const auto beside = cast_ray(finger, 0, 4);
  ASSERT_TRUE(beside.has_value());
  EXPECT_LT(beside->point[2], -0.5e-3);
}

TEST(CastRay, BesideTheSphereThereIsNothing) {
  EXPECT_FALSE(cast_ray({Kind::sphere, 3, 0, 20, 5, 1.41}, 9, 0).has_value());
}

// z = 0.25 + 0.1 x − 0.2 y mm on 5 × 4 nodes of 2 mm: a cubic convolution and its continuation at
// the rim leave a plane as it is.
TEST(HeightMap, APlaneStaysOneUpToTheRim) {
  recon::SurfaceHeights heights{.width = 5, .height = 4, .spacing_mm = 2, .z_um = {}};
  for (const int y : {-3, -1, 1, 3}) {
    for (const int x : {-4, -2, 0, 2, 4}) heights.z_um.push_back(250 + 100 * x - 200 * y);
  }
  const HeightMap map(heights);
  for (const double x : {-4.0, -3.1, 0.3, 2.0, 4.0}) {
    for (const double y : {-3.0, -2.9, 0.0, 1.7, 3.0}) {
      const auto found = map.at(x, y);
      ASSERT_TRUE(found.has_value());
      EXPECT_NEAR(found->z_mm, 0.25 + 0.1 * x - 0.2 * y, 1e-12);
      EXPECT_NEAR(found->slope_x, 0.1, 1e-12);
      EXPECT_NEAR(found->slope_y, -0.2, 1e-12);
    }
  }
  EXPECT_FALSE(map.at(4.01, 0).has_value());
  EXPECT_FALSE(map.at(0, -3.01).has_value());
  EXPECT_FALSE(map.at(std::nan(""), 0).has_value());
}

// Nodes of 0, 0, 1, 1 mm along x: half way up 0.5 with the steepest slope, at a quarter of the step
// (s = 1/4: w = −9/128, 111/128, 29/128, −3/128) 26/128.
TEST(HeightMap, AStepIsKeysCubic) {
  recon::SurfaceHeights heights{.width = 4, .height = 4, .spacing_mm = 1, .z_um = {}};
  for (int row = 0; row < 4; ++row) heights.z_um.insert(heights.z_um.end(), {0, 0, 1000, 1000});
  const HeightMap map(heights);
  EXPECT_NEAR(map.at(0, 0.2)->z_mm, 0.5, 1e-12);
  EXPECT_NEAR(map.at(0, 0.2)->slope_x, 1.25, 1e-12);
  EXPECT_NEAR(map.at(-0.25, 0.2)->z_mm, 26.0 / 128, 1e-12);
  EXPECT_NEAR(map.at(-0.5, -1.5)->z_mm, 0, 1e-12);
}

TEST(HeightMap, RefusesContradictingSizes) {
  EXPECT_THROW(HeightMap({.width = 4, .height = 4, .spacing_mm = 1, .z_um = {1, 2, 3}}),
               std::invalid_argument);
  EXPECT_THROW(
      HeightMap(
          {.width = 3, .height = 4, .spacing_mm = 1, .z_um = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}}),
      std::invalid_argument);
  EXPECT_THROW((void)cast_ray({.kind = Kind::height_map}, 0, 0), std::invalid_argument);
}

// What is looked at lies on a wall between two nodes: the ray's first crossing counts.
TEST(HeightMap, ARayEndsWhereItFirstLeavesTheGel) {
  recon::SurfaceHeights heights{.width = 12, .height = 4, .spacing_mm = 1, .z_um = {}};
  for (int row = 0; row < 4; ++row) {
    // A valley of 3 mm between x = 1.5 and 4.5.
    heights.z_um.insert(heights.z_um.end(), {0, 0, 0, 0, 0, 0, 0, 0, -3000, -3000, 0, 0});
  }
  const HeightMap map(heights);
  // Level enough to pass below the valley's far side again, were it not for its near one.
  const auto found = map.reached({0, 0, -4}, {4, 0, 2.4});
  ASSERT_TRUE(found.has_value());
  EXPECT_LT(4 * *found, 3);
  EXPECT_NEAR(map.at(4 * *found, 0)->z_mm, -4 + 2.4 * *found, 1e-9);
  EXPECT_FALSE(map.reached({0, 0, 1}, {0, 0, 1}).has_value()) << "begins outside";
  EXPECT_FALSE(map.reached({0, 0, -4}, {0, 9, 1}).has_value()) << "leaves beside the grid";
}

// Of a level surface the lowest and the highest place are one, so that rounding alone decides on
// which side of them a ray meets it.
TEST(HeightMap, ALevelSurfaceIsReachedAtEveryHeight) {
  for (int z_um = -4990; z_um <= 4990; z_um += 97) {
    const HeightMap map(
        {.width = 4, .height = 5, .spacing_mm = 3, .z_um = std::vector<std::int32_t>(20, z_um)});
    for (const double x : {-0.7, 0.0, 0.9}) {
      const auto found = map.reached({x, 0.1, -5.5}, {x / 7, 0.02, 5.5});
      ASSERT_TRUE(found.has_value()) << z_um << " um at " << x;
      EXPECT_NEAR(-5.5 + 5.5 * *found, 1e-3 * z_um, 1e-9);
    }
  }
}

/// The worst distance between what rays meet of both, and the worst angle between the normals,
/// over a map's pixels within `reach_mm` of the middle.
struct Apart {
  double mm = 0;
  double degrees = 0;
};
Apart apart(const recon::Surface& a, const recon::Surface& b, double reach_mm) {
  constexpr int kSize = 61;
  const double px = 2 * reach_mm / (kSize - 1);
  const SurfaceTable one = make_surface_table(a, kSize, kSize, px);
  const SurfaceTable other = make_surface_table(b, kSize, kSize, px);
  Apart worst;
  for (std::size_t i = 0; i < one.point[0].size(); ++i) {
    double between = 0;
    double turn = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      between += std::pow(double{one.point[axis][i]} - double{other.point[axis][i]}, 2);
      turn += std::pow(double{one.normal[axis][i]} - double{other.normal[axis][i]}, 2);
    }
    EXPECT_FALSE(std::isnan(between + turn)) << i;
    worst.mm = std::max(worst.mm, 1e3 * std::sqrt(between));
    worst.degrees = std::max(worst.degrees, std::sqrt(turn) * 180 / M_PI);
  }
  return worst;
}

// Whole micrometres of nodes 0.5 mm apart: they alone move a point by up to half of one, a normal
// by about 0.1°.
TEST(CastRay, HeightsOfASphereAreTheSphere) {
  const recon::Surface sphere{Kind::sphere, 15, 0, 20, 8, 1.41};
  const Apart found = apart(sphere, test::sampled(sphere, 36, 0.5), 8);
  EXPECT_LT(found.mm, 0.001);
  EXPECT_LT(found.degrees, 0.15);
}

TEST(CastRay, HeightsOfACylinderAreTheCylinder) {
  const recon::Surface finger{Kind::cylinder, 12, 30, 20, 8, 1.41};
  const Apart found = apart(finger, test::sampled(finger, 35, 0.5), 8);
  EXPECT_LT(found.mm, 0.001);
  EXPECT_LT(found.degrees, 0.15);
}

TEST(CastRay, BesideTheHeightsThereIsNothing) {
  const recon::Surface heights = test::sampled({Kind::sphere, 30, 0, 20, 5, 1.41}, 9, 1);
  EXPECT_TRUE(cast_ray(heights, 4, 4).has_value());
  // The ray meets the surface before it meets z = 0, further inside.
  EXPECT_FALSE(cast_ray(heights, 4.3, 0).has_value());
  EXPECT_FALSE(cast_ray(heights, 0, -40).has_value());
}

TEST(SurfaceTable, HasTheMapsPixels) {
  const SurfaceTable table = make_surface_table({Kind::sphere, 3, 0, 20, 5, 1.41}, 21, 11, 1);
  ASSERT_EQ(table.point[0].size(), 231U);
  EXPECT_NEAR(table.point[2][5 * 21 + 10], 0, 1e-9);
  EXPECT_FLOAT_EQ(table.normal[2][5 * 21 + 10], 1);
  EXPECT_TRUE(std::isnan(table.point[2][0]));
  EXPECT_TRUE(std::isnan(table.normal[0][0]));
  // Right of the middle, and below it.
  EXPECT_GT(table.point[0][5 * 21 + 11], 0.5e-3F);
  EXPECT_GT(table.point[1][6 * 21 + 10], 0.5e-3F);
}

TEST(FootOf, IsWhereThePointWasLiftedFrom) {
  for (const recon::Surface& surface :
       {recon::Surface{Kind::sphere, 12, 0, 20, 8, 1.41},
        {Kind::cylinder, 9, 30, 15, 6, 1.41},
        test::sampled({Kind::sphere, 12, 0, 20, 8, 1.41}, 25, 0.5)}) {
    constexpr double kPx = 0.05;
    const SurfaceTable table = make_surface_table(surface, 201, 161, kPx);
    for (const double column : {0.4, 17.3, 100.0, 188.9}) {
      for (const double row : {0.3, 80.0, 151.6}) {
        const auto at = cast_ray(surface, (column - 100) * kPx, (row - 80) * kPx);
        ASSERT_TRUE(at.has_value());
        for (const double lift : {-1e-3, 0.0, 0.5e-3}) {
          Vector point = at->point;
          for (std::size_t i = 0; i < 3; ++i) point[i] += lift * at->normal[i];
          const auto foot = foot_of(table, point);
          ASSERT_TRUE(foot.has_value()) << column << ", " << row << ", " << lift;
          EXPECT_NEAR(foot->column, column, 0.02);
          EXPECT_NEAR(foot->row, row, 0.02);
          expect_near(foot->normal, at->normal, 1e-3);
        }
      }
    }
  }
}

TEST(FootOf, BesideTheTableThereIsNone) {
  const SurfaceTable table = make_surface_table({Kind::sphere, 12, 0, 20, 8, 1.41}, 101, 101, 0.05);
  EXPECT_TRUE(foot_of(table, {2.3e-3, 0, 0}).has_value());
  EXPECT_FALSE(foot_of(table, {2.7e-3, 0, -0.3e-3}).has_value());
  EXPECT_FALSE(foot_of(table, {0, -9e-3, -4e-3}).has_value());
  EXPECT_FALSE(foot_of(table, {std::nan(""), 0, 0}).has_value());
  // Rays that miss the surface.
  const SurfaceTable wide = make_surface_table({Kind::sphere, 3, 0, 20, 5, 1.41}, 181, 181, 0.1);
  EXPECT_FALSE(foot_of(wide, {8e-3, 0, -2e-3}).has_value());
}

}  // namespace
}  // namespace dtact::perceive
