#include "hal/sim/placement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

constexpr double kDegree = 3.14159265358979 / 180;

// 161 points each way, 0.125 mm apart, the origin in the middle.
const Grid kPlate{161, 161, 0.125, -10, -10};

PressKey key_of(double depth_mm, double tilt_x_deg, double tilt_y_deg, double rotation_deg = 0) {
  PressKey key;
  key.depth_mm = depth_mm;
  key.rotation_deg = rotation_deg;
  key.tilt_x_deg = tilt_x_deg;
  key.tilt_y_deg = tilt_y_deg;
  return key;
}

cv::Mat1d target_of(const Object& object, const PressKey& key) {
  cv::Mat1d target(kPlate.height, kPlate.width, -kNoSurface);
  lower_object({}, object, key, 2, kPlate, target);
  return target;
}

double at(const cv::Mat1d& target, double x_mm, double y_mm) {
  return target(static_cast<int>(std::lround((y_mm + 10) / 0.125)),
                static_cast<int>(std::lround((x_mm + 10) / 0.125)));
}

TEST(Placement, ARotationVectorTurnsRightHanded) {
  const cv::Vec3d right(1, 0, 0);
  const cv::Vec3d down = rotation_of({0, 0, 90}) * right;  // clockwise as the camera sees it
  EXPECT_NEAR(down[1], 1, 1e-12);
  const cv::Vec3d in = rotation_of({0, 30, 0}) * right;
  EXPECT_NEAR(in[2], -0.5, 1e-12);
  EXPECT_NEAR(in[0], 0.8660254, 1e-7);
}

TEST(Placement, UprightPoseIsDepthPlaceAndRotation) {
  PressKey key = key_of(0.7, 0, 0, 20);
  key.x_mm = 1;
  key.y_mm = -2;
  const Pose pose = pose_of({}, m4_nut(), key);
  EXPECT_DOUBLE_EQ(pose.x_mm, 1);
  EXPECT_DOUBLE_EQ(pose.y_mm, -2);
  EXPECT_DOUBLE_EQ(pose.z_mm, -0.7);
  EXPECT_NEAR(pose.turn_deg[0], 0, 1e-12);
  EXPECT_NEAR(pose.turn_deg[2], 20, 1e-12);
}

TEST(Placement, ATurnBeyondHalfARoundIsTheShorterOneBack) {
  EXPECT_NEAR(pose_of({}, cube(4), key_of(0, 0, 0, 270)).turn_deg[2], -90, 1e-9);
}

// First the rotation, then the tilt, about the sensor's axes.
TEST(Placement, TiltTurnsAfterTheRotation) {
  const Pose pose = pose_of({}, cube(4), key_of(0.5, 15, 0, 90));
  const cv::Vec3d edge = rotation_of(pose.turn_deg) * cv::Vec3d(1, 0, 0);  // 90: downwards
  EXPECT_NEAR(edge[1], std::cos(15 * kDegree), 1e-9);
  EXPECT_NEAR(edge[2], std::sin(15 * kDegree), 1e-9);  // tilt_x lifts the lower edge
}

// A ball looks the same from all sides: tilted by a it is the upright one R sin(a) farther along.
TEST(Placement, ATiltedBallIsABall) {
  for (const double tilt : {15.0, 45.0, -60.0}) {
    const cv::Mat1d tilted = target_of(ball(2), key_of(1.1, tilt, 0));
    const double centre = -2 * std::sin(tilt * kDegree);
    for (int i = 0; i < kPlate.height; ++i) {
      for (int j = 0; j < kPlate.width; ++j) {
        const double r = std::hypot(j * 0.125 - 10, i * 0.125 - 10 - centre);
        if (r > 1.98) continue;  // near the side a step of the search may miss it
        ASSERT_NEAR(tilted(i, j), 1.1 - (2 - std::sqrt(4 - r * r)), 3e-6);
      }
    }
  }
}

// The lowest point is searched for on a coarse grid and then more finely around the best one of it,
// wherever that is. The origin of a ball of radius R that is tilted by a lies R (1 - cos a) above
// its lowest point.
TEST(Placement, TheLowestPointIsFoundExactly) {
  for (const double radius : {0.4, 2.0, 3.7}) {
    for (int i = -29; i <= 29; ++i) {
      const double tilt = 2.03 * i;
      const double lowest = -radius * (1 - std::cos(tilt * kDegree));
      EXPECT_NEAR(pose_of({}, ball(radius), key_of(0.3, tilt, 0)).z_mm, -0.3 - lowest, 1e-6)
          << radius << " " << tilt;
      EXPECT_NEAR(pose_of({}, ball(radius), key_of(0.3, 0, tilt)).z_mm, -0.3 - lowest, 1e-6)
          << radius << " " << tilt;
    }
  }
  // On a corner that is no point of the grid: cube of 2.3 mm, rolled about a diagonal.
  EXPECT_NEAR(pose_of({}, cube(2.3), key_of(0.3, 10, 10)).z_mm,
              -0.3 + 1.15 * std::numbers::sqrt2 * std::sin(10 * std::numbers::sqrt2 * kDegree),
              1e-5);
}

TEST(Placement, ACylinderRollsAboutItsAxis) {
  const cv::Mat1d rolled = target_of(cylinder(3, 8), key_of(1, 40, 0));
  const double axis = -3 * std::sin(40 * kDegree);
  EXPECT_NEAR(at(rolled, 3, -2), 1 - (3 - std::sqrt(9 - (-2 - axis) * (-2 - axis))), 1e-5);
  EXPECT_EQ(at(rolled, 4.125, -2), -kNoSurface);
}

// Pressed in with its right edge: the face falls by tan 15° a millimetre to the left, the wall to
// the right stands at 75°.
TEST(Placement, ACubeRocksOnItsEdge) {
  const double tan15 = std::tan(15 * kDegree);
  const Pose pose = pose_of({}, cube(4), key_of(0.6, 0, 15));
  EXPECT_NEAR(pose.z_mm, -0.6 + 2 * std::sin(15 * kDegree), 1e-5);
  const cv::Mat1d target = target_of(cube(4), key_of(0.6, 0, 15));
  const double edge = 2 * std::cos(15 * kDegree);  // 1.932
  for (const double x : {1.875, 1.0, 0.0, -1.5}) {
    EXPECT_NEAR(at(target, x, 0.5), 0.6 - (edge - x) * tan15, 1e-5) << x;
  }
  EXPECT_NEAR(at(target, 2.125, 0.5), 0.6 - (2.125 - edge) / tan15, 1e-5);
  EXPECT_EQ(at(target, 1, 2.125), -kNoSurface);
}

TEST(Placement, TheLowestPointIsAsDeepAsTheKeySays) {
  for (const Object& object : {ball(3), star(5), m4_nut(), three_set_screws(), key()}) {
    const PressKey key = key_of(0.8, 9, -12, 33);
    const cv::Mat1d target = target_of(object, key);
    EXPECT_LE(*std::max_element(target.begin(), target.end()), 0.8) << object.kind;
    EXPECT_GT(*std::max_element(target.begin(), target.end()), 0.74) << object.kind;
  }
}

TEST(Placement, KeysAreJoinedByStraightLines) {
  const Scene scene = small_scene(R"(
[[press]]
object = "cube"
side_mm = 4.0
keys = [ { t = 1.0, tilt_x = 10.0 }, { t = 3.0, depth = 0.5, tilt_y = -20.0 } ]
)");
  EXPECT_FALSE(key_at(scene.presses[0], 0.9));
  const auto half = key_at(scene.presses[0], 2);
  ASSERT_TRUE(half);
  EXPECT_DOUBLE_EQ(half->depth_mm, 0.25);
  EXPECT_DOUBLE_EQ(half->tilt_x_deg, 10);
  EXPECT_DOUBLE_EQ(half->tilt_y_deg, -10);
}

}  // namespace
}  // namespace dtact::hal::sim
