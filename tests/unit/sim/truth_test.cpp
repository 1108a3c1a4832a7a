#include "hal/sim/truth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

float deepest(const Truth& truth, std::uint64_t sequence) {
  std::vector<float> map;
  truth.indentation_mm(sequence, map);
  return *std::max_element(map.begin(), map.end());
}

TEST(Truth, FollowsTheDepthOverTime) {
  const Truth truth(small_scene());  // 10 frames a second, down from 1 s to 2 s
  EXPECT_EQ(deepest(truth, 0), 0);
  EXPECT_EQ(deepest(truth, 10), 0);
  EXPECT_NEAR(deepest(truth, 15), 0.5, 0.01);
  EXPECT_NEAR(deepest(truth, 20), 1.0, 0.01);  // the pixels are beside the lowest point
  EXPECT_NEAR(deepest(truth, 5000), 1.0, 0.01);
}

TEST(Truth, IsPure) {
  const Truth a(small_scene());
  const Truth b(small_scene());
  std::vector<float> forwards;
  std::vector<float> again;
  a.indentation_mm(14, forwards);
  (void)deepest(b, 30);
  b.indentation_mm(14, again);
  EXPECT_EQ(forwards, again);
}

TEST(Truth, IsABallInTheContactAndBulgesOutside) {
  const Truth truth(small_scene());
  std::vector<float> map;
  std::vector<std::uint8_t> contact;
  truth.indentation_mm(30, map);
  truth.contact(30, contact);
  ASSERT_EQ(map.size(), 160U * 120U);
  ASSERT_EQ(contact.size(), map.size());
  int in_contact = 0;
  float lowest = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const auto i = pixel(x, y);
      lowest = std::min(lowest, map[i]);
      // The camera is 28 mm above.
      const double r = std::hypot(x - 79.5, y - 59.5) * 0.2 * (1 - double{map[i]} / 28);
      if (contact[i] == 255 && r < 2) {
        ++in_contact;
        // Sphere of radius 4, 1 mm deep; 0.006 for straight lines between points 0.25 mm apart.
        ASSERT_NEAR(map[i], 1 - (4 - std::sqrt(16 - r * r)), 0.006);
      }
      if (r > 4) {
        ASSERT_EQ(contact[i], 0);
      }
    }
  }
  EXPECT_GT(in_contact, 300);  // π 2² / 0.2² = 314
  EXPECT_LT(lowest, -0.02F);
}

TEST(Truth, SolvesAStateOnceForPressAndRelease) {
  const Scene scene = small_scene(R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 1.0 }, { t = 2.0, depth = 0.6 }, { t = 3.0 }, { t = 4.0, depth = 0.0 } ]
)");
  EXPECT_EQ(Truth(scene).map_count(), 3U);  // no contact, 0.3 mm, 0.6 mm
}

TEST(Truth, PlaceAndRotationAreTheSenses) {
  const Scene scene = small_scene(R"(
[[press]]
object = "cylinder"
radius_mm = 2.0
length_mm = 10.0
keys = [ { t = 0.0, x = 4.0, y = -3.0, depth = 0.5, rotation = 45.0 } ]
)");
  std::vector<float> map;
  Truth(scene).indentation_mm(0, map);
  const auto at = [&](double x_mm, double y_mm) {
    return map[pixel(static_cast<int>(std::lround(79.5 + x_mm / 0.2)),
                     static_cast<int>(std::lround(59.5 + y_mm / 0.2)))];
  };
  EXPECT_GT(at(4, -3), 0.4F);
  // Clockwise with y downwards: the axis turns from the right towards the lower right.
  EXPECT_GT(at(4 + 2.5, -3 + 2.5), 0.4F);
  EXPECT_LT(at(4 + 2.5, -3 - 2.5), 0.05F);
}

TEST(Truth, ReportsWhereTheObjectIs) {
  const Scene scene = small_scene(R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 1.0 }, { t = 2.0, depth = 1.0 }, { t = 3.0, x = 2.0, rotation = 10.0 } ]
)");
  const Truth truth(scene);
  EXPECT_FALSE(truth.pose(0, 9));
  const auto half_down = truth.pose(0, 15);
  ASSERT_TRUE(half_down);
  EXPECT_NEAR(half_down->z_mm, -0.5, 1e-12);
  const auto sliding = truth.pose(0, 25);
  ASSERT_TRUE(sliding);
  EXPECT_NEAR(sliding->x_mm, 1, 1e-12);
  EXPECT_NEAR(sliding->z_mm, -1, 1e-12);
  EXPECT_NEAR(sliding->turn_deg[2], 5, 1e-12);
  EXPECT_THROW((void)truth.pose(1, 0), std::out_of_range);
}

// A bonded gel no thicker than the contact is wide needs more than the half-space's 16/9 E √R
// d^1.5.
TEST(Truth, ForceGrowsWithDepthAndIsYoungsModulusTimesAShape) {
  Scene scene = small_scene();  // R = 4 mm, 1 mm at frame 20
  scene.gel.youngs_modulus_mpa = 0.1;
  const Truth soft(scene);
  EXPECT_EQ(soft.force_n(5), 0);
  EXPECT_GT(soft.force_n(20), 16.0 / 9 * 0.1 * 2);
  EXPECT_LT(soft.force_n(15), soft.force_n(20) / std::pow(2, 1.5));
  scene.gel.youngs_modulus_mpa = 0.3;
  EXPECT_NEAR(Truth(scene).force_n(20), 3 * soft.force_n(20), 1e-9);
}

TEST(Truth, FollowsATilt) {
  const Scene scene = small_scene(R"(
[[press]]
object = "ball"
radius_mm = 4.0
keys = [ { t = 0.0, depth = 0.8 }, { t = 1.0, tilt_y = 15.0 } ]
)");
  const Truth truth(scene);
  std::vector<float> map;
  truth.indentation_mm(10, map);
  const auto deepest = std::max_element(map.begin(), map.end()) - map.begin();
  EXPECT_NEAR((static_cast<double>(deepest % 160) - 79.5) * 0.2, 4 * std::sin(15 * 0.01745329),
              0.2);
  EXPECT_NEAR(truth.force_n(10), truth.force_n(0), 0.01 * truth.force_n(0));
}

TEST(Truth, DraggedGelFollowsAContactAndComesAfterItAround) {
  const auto map_of = [](const char* drag) {
    std::vector<float> map;
    const Truth truth(small_scene(std::string(R"(
[[press]]
object = "cube"
side_mm = 4.0
keys = [ { t = 0.0, x = 1.0, y = -0.6, depth = 0.6)") +
                                  drag + " } ]\n"));
    truth.indentation_mm(0, map);
    return map;
  };
  const std::vector<float> still = map_of("");
  const std::vector<float> moved = map_of(", drag_x = 0.4, drag_y = -0.2");
  // The contact goes from column 75 to 94: x = -1 to 3 mm.
  for (int column = 77; column < 93; ++column) {
    EXPECT_NEAR(moved[pixel(column, 55)], still[pixel(column, 55)], 0.005) << column;
  }
  // Two millimetres ahead of it and behind it the gel is where it was: 0.4 mm are two columns.
  for (const int column : {62, 107}) {
    EXPECT_NEAR(moved[pixel(column, 55)], still[pixel(column + 2, 54)], 0.003) << column;
  }
  EXPECT_GT(std::abs(moved[pixel(97, 55)] - still[pixel(97, 55)]), 0.005);
}

TEST(Truth, BarrelPutsTheBorderFartherOut) {
  CameraModel camera = small_scene().camera;
  camera.barrel = 0.25;
  EXPECT_NEAR(pixel_place(camera, 159, 119).x_mm, 79.5 * 0.2 * 1.25, 1e-9);
  EXPECT_NEAR(pixel_place(camera, 79.5, 59.5).x_mm, 0, 1e-9);
  Scene scene = small_scene();
  scene.camera.barrel = 0.25;
  EXPECT_GE(-make_grid(scene).x0_mm, 79.5 * 0.2 * 1.25 + 4 * 2.0 - 0.25);
}

TEST(Truth, TwoObjectsShareTheLayer) {
  const Scene scene = small_scene(R"(
[[press]]
object = "ball"
radius_mm = 3.0
keys = [ { t = 0.0, x = -6.0, depth = 0.6 } ]
[[press]]
object = "ball"
radius_mm = 3.0
keys = [ { t = 0.0, x = 6.0, depth = 0.4 } ]
)");
  std::vector<float> map;
  Truth(scene).indentation_mm(0, map);
  const float* const row = &map[pixel(0, 59)];
  EXPECT_NEAR(*std::max_element(row, row + 80), 0.6, 0.01);
  EXPECT_NEAR(*std::max_element(row + 80, row + 160), 0.4, 0.01);
}

}  // namespace
}  // namespace dtact::hal::sim
