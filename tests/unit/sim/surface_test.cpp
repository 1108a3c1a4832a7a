#include "hal/sim/surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/sim/placement.hpp"
#include "hal/sim/truth.hpp"
#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

const SurfaceModel kSphere{SurfaceShape::sphere, 20, 15};
const SurfaceModel kCylinder{SurfaceShape::cylinder, 20, 15};

void expect_near(const cv::Vec3d& a, const cv::Vec3d& b) {
  EXPECT_NEAR(cv::norm(a - b), 0, 1e-9) << a << " " << b;
}

TEST(Surface, APlaneIsWhereItIsSeen) {
  const Place place = unrolled({}, {3, -2});
  EXPECT_EQ(place.x_mm, 3);
  EXPECT_EQ(place.y_mm, -2);
  expect_near(point_at({}, place).at, {3, -2, 0});
  expect_near(point_at({}, place).normal, {0, 0, 1});
}

TEST(Surface, WhatIsPressedLiesOnTheRay) {
  const SurfaceModel plane{SurfaceShape::plane, 0, 25};
  EXPECT_NEAR(unrolled(plane, {5, -3}, 1).x_mm, 4.8, 1e-12);
  EXPECT_NEAR(unrolled(plane, {5, -3}, 1).y_mm, -2.88, 1e-12);
  for (const SurfaceModel& surface : {kSphere, kCylinder}) {
    const SurfacePoint point = point_at(surface, unrolled(surface, {6, -8}, 1.5));
    const cv::Vec3d ray = point.at - 1.5 * point.normal - cv::Vec3d(0, 0, -15);
    EXPECT_NEAR(ray[0] / ray[2], 6.0 / 15, 1e-12);
    EXPECT_NEAR(ray[1] / ray[2], -8.0 / 15, 1e-12);
  }
}

// A ball pressed 1 mm deep at (−8, 5) appears farther out: at depth d by 1 / (1 − d / 25).
TEST(Surface, AnImageShowsPressedPointsFartherOut) {
  for (const char* camera : {"camera_mm = 0.0", "camera_mm = 25.0"}) {
    const Truth truth(small_scene(std::string("[surface]\n") + camera + R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 0.0, x = -8.0, y = 5.0, depth = 1.0 } ]
)"));
    const double height = truth.scene().surface.camera_mm;
    std::vector<float> depth;
    truth.indentation_mm(0, depth);
    double worst = 0;
    for (int row = 0; row < 120; ++row) {
      for (int column = 0; column < 160; ++column) {
        const double d = depth[pixel(column, row)];
        if (d < 0.5) continue;
        const double rest = height > 0 ? 1 - d / height : 1;
        const double x = (column - 79.5) * 0.2 * rest + 8;
        const double y = (row - 59.5) * 0.2 * rest - 5;
        worst = std::max(worst, std::abs(d - (std::sqrt(16 - x * x - y * y) - 3)));
      }
    }
    EXPECT_LT(worst, 0.009) << camera << ": the grid is coarse";
  }
}

TEST(Surface, TheApexIsTheOrigin) {
  for (const SurfaceModel& surface : {kSphere, kCylinder}) {
    EXPECT_EQ(unrolled(surface, {}).x_mm, 0);
    expect_near(point_at(surface, {}).at, {0, 0, 0});
    expect_near(point_at(surface, {}).normal, {0, 0, 1});
  }
}

// The point lies on the sphere and on the straight line from the camera at (0, 0, −15) through the
// plane.
TEST(Surface, ARayMeetsTheSphere) {
  const SurfacePoint point = point_at(kSphere, unrolled(kSphere, {6, -8}));
  EXPECT_NEAR(cv::norm(point.at - cv::Vec3d(0, 0, -20)), 20, 1e-9);
  const cv::Vec3d ray = point.at - cv::Vec3d(0, 0, -15);
  EXPECT_NEAR(ray[0] / ray[2], 6.0 / 15, 1e-12);
  EXPECT_NEAR(ray[1] / ray[2], -8.0 / 15, 1e-12);
  expect_near(point.normal, (point.at - cv::Vec3d(0, 0, -20)) / 20);
}

TEST(Surface, ARayMeetsTheCylinder) {
  const SurfacePoint point = point_at(kCylinder, unrolled(kCylinder, {6, -8}));
  EXPECT_NEAR(std::hypot(point.at[1], point.at[2] + 20), 20, 1e-9);
  const cv::Vec3d ray = point.at - cv::Vec3d(0, 0, -15);
  EXPECT_NEAR(ray[0] / ray[2], 6.0 / 15, 1e-12);
  EXPECT_NEAR(ray[1] / ray[2], -8.0 / 15, 1e-12);
  EXPECT_EQ(point.normal[0], 0);
}

// A quarter of the sphere's circumference is 10 π from the apex, to the right.
TEST(Surface, UnrollsByArcs) {
  const double quarter = 10 * 3.14159265358979;
  expect_near(point_at(kSphere, {quarter, 0}).at, {20, 0, -20});
  expect_near(point_at(kCylinder, {7, quarter}).at, {7, 20, -20});
  expect_near(point_at(kCylinder, {7, quarter}).normal, {0, 1, 0});
}

TEST(Surface, ItsTurnTakesTheAxisToTheNormal) {
  for (const SurfaceModel& surface : {kSphere, kCylinder}) {
    const SurfacePoint point = point_at(surface, {4, -7});
    expect_near(rotation_of(point.turn_deg) * cv::Vec3d(0, 0, 1), point.normal);
  }
}

TEST(Surface, APoseStandsOnTheNormal) {
  PressKey key;
  key.y_mm = 20 * 0.5;  // half a radian down
  key.depth_mm = 0.4;
  const Pose pose = pose_of(kCylinder, ball(3), key);
  EXPECT_NEAR(pose.y_mm, 19.6 * std::sin(0.5), 1e-9);
  EXPECT_NEAR(pose.z_mm, 19.6 * std::cos(0.5) - 20, 1e-9);
  EXPECT_NEAR(pose.turn_deg[0], -28.64788976, 1e-6);
}

// A ball of radius r is pressed d deep into a sphere of radius R. On the normal at the arc s from
// its lowest point it begins at the R' that has distance r to its centre at R + r − d.
TEST(Surface, ABallOnASphereReachesAsDeepAsGeometrySays) {
  const Grid grid{81, 81, 0.125, -5, -5};
  cv::Mat1d target(grid.height, grid.width, -kNoSurface);
  PressKey key;
  key.depth_mm = 0.8;
  lower_object(kSphere, ball(4), key, 2, grid, target);
  EXPECT_NEAR(target(40, 40), 0.8, 1e-5);
  const double centre = 20 + 4 - 0.8;
  for (const int column : {44, 48, 56}) {
    const double angle = (column - 40) * 0.125 / 20;
    const double along = centre * std::cos(angle);
    const double across = centre * std::sin(angle);
    EXPECT_NEAR(target(40, column), 20 - (along - std::sqrt(16 - across * across)), 1e-5);
    EXPECT_NEAR(target(column, 40), target(40, column), 1e-5);
  }
}

TEST(Surface, ASceneIsRenderedOnIt) {
  const std::string curved = R"(
[surface]
shape = "cylinder"
radius_mm = 20.0
camera_mm = 15.0
)";
  const Scene scene = small_scene(curved + R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 0.0, y = 5.0, depth = 0.8 } ]
)");
  const Truth truth(scene);
  std::vector<float> map;
  truth.indentation_mm(0, map);
  const auto deepest = std::max_element(map.begin(), map.end()) - map.begin();
  EXPECT_NEAR(map[static_cast<std::size_t>(deepest)], 0.8, 0.02);
  // The pixel that shows it: 5 mm of arc are a quarter of a radian.
  const auto column = deepest % 160;
  const auto row = deepest / 160;
  const cv::Vec3d at = truth.surface_at(static_cast<double>(column), static_cast<double>(row)).at;
  EXPECT_NEAR(cv::norm(at - cv::Vec3d(0, 20 * std::sin(0.25), 20 * std::cos(0.25) - 20)), 0, 0.25);
  const auto pose = truth.pose(0, 0);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->y_mm, 19.2 * std::sin(0.25), 1e-9);
  EXPECT_GT(truth.force_n(0), 0.1);
}

}  // namespace
}  // namespace dtact::hal::sim
