#include "clients/geometry/surface_table.hpp"

#include <gtest/gtest.h>

#include <cmath>

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

TEST(CastRay, OnAPlaneSeenFromNearTheRayLeansAwayFromTheAxis) {
  const recon::Surface surface{.view = {{1, -1}, 0.04}};
  const auto found = cast_ray(surface, 6, -4);
  ASSERT_TRUE(found.has_value());
  expect_near(found->point, {6e-3, -4e-3, 0}, 1e-15);
  expect_near(found->ray, {0.2, -0.12, 1}, 1e-15);
}

TEST(CastRay, PointsBelowASphereLieOnTheRay) {
  const recon::Surface sphere{Kind::sphere, 12, 0, 20, 5, 1};
  const auto found = cast_ray(sphere, 3, -2);
  ASSERT_TRUE(found.has_value());
  // The camera is at (0, 0, −25) and sees (3, −2, 0).
  const Vector below = along(found->point, -0.8e-3, found->ray);
  EXPECT_NEAR(below[0] / (below[2] + 25e-3), 3.0 / 25, 1e-12);
  EXPECT_NEAR(below[1] / (below[2] + 25e-3), -2.0 / 25, 1e-12);
  const SurfaceTable table = make_surface_table(sphere, 301, 201, 0.05);
  const auto seen = project_to_surface(table, below);
  ASSERT_TRUE(seen.has_value());
  EXPECT_NEAR(seen->column, 150 + 60, 0.02);
  EXPECT_NEAR(seen->row, 100 - 40, 0.02);
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

TEST(SurfaceTable, HasTheMapsWidthHeightAndScale) {
  const SurfaceTable table = make_surface_table({Kind::sphere, 12, 0, 20, 8, 1.41}, 21, 11, 0.5);
  EXPECT_EQ(table.width, 21);
  EXPECT_EQ(table.height, 11);
  EXPECT_EQ(table.mm_per_px, 0.5);
}

TEST(ProjectToSurface, IsWhereThePointWasLiftedFrom) {
  for (const recon::Surface& surface :
       {recon::Surface{Kind::sphere, 12, 0, 20, 8, 1.41}, {Kind::cylinder, 9, 30, 15, 6, 1.41}}) {
    constexpr double kPx = 0.05;
    const SurfaceTable table = make_surface_table(surface, 201, 161, kPx);
    for (const double column : {0.4, 17.3, 100.0, 188.9}) {
      for (const double row : {0.3, 80.0, 151.6}) {
        const auto at = cast_ray(surface, (column - 100) * kPx, (row - 80) * kPx);
        ASSERT_TRUE(at.has_value());
        for (const double lift : {-1e-3, 0.0, 0.5e-3}) {
          Vector point = at->point;
          for (std::size_t i = 0; i < 3; ++i) point[i] += lift * at->ray[i];
          const auto projection = project_to_surface(table, point);
          ASSERT_TRUE(projection.has_value()) << column << ", " << row << ", " << lift;
          EXPECT_NEAR(projection->column, column, 0.02);
          EXPECT_NEAR(projection->row, row, 0.02);
          expect_near(projection->normal, at->normal, 1e-3);
        }
      }
    }
  }
}

TEST(ProjectToSurface, BesideTheTableThereIsNone) {
  const SurfaceTable table = make_surface_table({Kind::sphere, 12, 0, 20, 8, 1.41}, 101, 101, 0.05);
  EXPECT_TRUE(project_to_surface(table, {2.3e-3, 0, 0}).has_value());
  EXPECT_FALSE(project_to_surface(table, {2.7e-3, 0, -0.3e-3}).has_value());
  EXPECT_FALSE(project_to_surface(table, {0, -9e-3, -4e-3}).has_value());
  EXPECT_FALSE(project_to_surface(table, {std::nan(""), 0, 0}).has_value());
  // Rays that miss the surface.
  const SurfaceTable wide = make_surface_table({Kind::sphere, 3, 0, 20, 5, 1.41}, 181, 181, 0.1);
  EXPECT_FALSE(project_to_surface(wide, {8e-3, 0, -2e-3}).has_value());
}

// A table that is wider than high, and one that is higher than wide: each side has its own length.
TEST(ProjectToSurface, EndsAtEachSideOfTheTable) {
  const recon::Surface sphere{Kind::sphere, 12, 0, 20, 8, 1.41};
  const SurfaceTable wide = make_surface_table(sphere, 121, 61, 0.05);  // to 3 and 1.5 mm
  const SurfaceTable tall = make_surface_table(sphere, 61, 121, 0.05);
  const auto shown = [&](const SurfaceTable& table, double x_mm, double y_mm) {
    return project_to_surface(table, cast_ray(sphere, x_mm, y_mm).value().point).has_value();
  };
  for (const double side : {-1.0, 1.0}) {
    EXPECT_TRUE(shown(wide, 2.9 * side, 0)) << side;
    EXPECT_FALSE(shown(wide, 3.1 * side, 0)) << side;
    EXPECT_TRUE(shown(wide, 0, 1.4 * side)) << side;
    EXPECT_FALSE(shown(wide, 0, 1.6 * side)) << side;
    EXPECT_TRUE(shown(tall, 1.4 * side, 0)) << side;
    EXPECT_FALSE(shown(tall, 1.6 * side, 0)) << side;
    EXPECT_TRUE(shown(tall, 0, 2.9 * side)) << side;
    EXPECT_FALSE(shown(tall, 0, 3.1 * side)) << side;
  }
}

}  // namespace
}  // namespace dtact::perceive
