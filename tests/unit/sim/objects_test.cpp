#include "hal/sim/objects.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::hal::sim {
namespace {

TEST(Objects, Ball) {
  const Object o = ball(5);
  EXPECT_DOUBLE_EQ(o.height_mm(0, 0), 0);
  EXPECT_DOUBLE_EQ(o.height_mm(3, 0), 1);  // 5 − √(25 − 9)
  EXPECT_DOUBLE_EQ(o.height_mm(0, -4), 2);
  EXPECT_EQ(o.height_mm(5.1, 0), kNoSurface);
}

TEST(Objects, BallArrayHasAMinimumAtEveryPlace) {
  const Object o = ball_array(1, 4, 3, 4);
  EXPECT_DOUBLE_EQ(o.height_mm(-6, -4), 0);
  EXPECT_DOUBLE_EQ(o.height_mm(2, 0), 0);
  EXPECT_NEAR(o.height_mm(6, 4.6), 0.2, 1e-12);  // 1 − √(1 − 0.36)
  EXPECT_EQ(o.height_mm(0, 0), kNoSurface);
}

TEST(Objects, FlatOnes) {
  EXPECT_EQ(disc(4).height_mm(2.8, 2.8), 0);
  EXPECT_EQ(disc(4).height_mm(2.9, 2.9), kNoSurface);
  EXPECT_EQ(cube(7).height_mm(3.5, -3.5), 0);
  EXPECT_EQ(cube(7).height_mm(3.6, 0), kNoSurface);
}

TEST(Objects, TwoPillars) {
  const Object o = two_pillars(0.5, 1.5);
  EXPECT_EQ(o.height_mm(0.75, 0.4), 0);
  EXPECT_EQ(o.height_mm(-1.24, 0), 0);
  EXPECT_EQ(o.height_mm(0, 0), kNoSurface);
  EXPECT_DOUBLE_EQ(o.reach_mm, 1.25);
}

TEST(Objects, CylinderLiesAlongX) {
  const Object o = cylinder(2.5, 12);
  EXPECT_DOUBLE_EQ(o.height_mm(6, 0), 0);
  EXPECT_DOUBLE_EQ(o.height_mm(0, 1.5), 0.5);
  EXPECT_EQ(o.height_mm(6.1, 0), kNoSurface);
}

TEST(Objects, GratingHasRidgesAndGrooves) {
  const Object o = grating(2, 1, 10);
  EXPECT_EQ(o.height_mm(0, 0), 0);
  EXPECT_EQ(o.height_mm(1, 3), 1);
  EXPECT_EQ(o.height_mm(-2, 3), 0);
  EXPECT_EQ(o.height_mm(0, 5.1), kNoSurface);
}

// The board of shared/data/README.md: 9 columns, 7 rows, pitch 2.5 mm, 1.5 mm tall.
TEST(Objects, PinBoard) {
  const Object o = pin_board();
  EXPECT_DOUBLE_EQ(o.height_mm(10, 7.5), 0);
  EXPECT_DOUBLE_EQ(o.height_mm(1.25, 1.25), 1.5);
  EXPECT_NEAR(o.height_mm(0.36, 0), 0.12, 1e-12);  // 0.6 − √(0.36 − 0.1296)
}

// ISO 4032: 7 mm across flats, so 8.08 mm across corners.
TEST(Objects, M4Nut) {
  const Object o = m4_nut();
  EXPECT_EQ(o.height_mm(0, 0), kNoSurface);
  EXPECT_EQ(o.height_mm(2.5, 0), 0);
  EXPECT_EQ(o.height_mm(0, 3.51), kNoSurface);
  EXPECT_NEAR(o.height_mm(4.0, 0), (4.0 - 2.95) * 0.57735, 1e-5);
  EXPECT_EQ(o.height_mm(4.1, 0), kNoSurface);
}

TEST(Objects, M3LongNutLiesOnAFlat) {
  const Object o = m3_long_nut();
  EXPECT_EQ(o.height_mm(4.4, 1.5), 0);
  EXPECT_NEAR(o.height_mm(0, 3.1754), 2.75, 1e-3);  // the corners lie half the width higher
  EXPECT_EQ(o.height_mm(4.6, 0), kNoSurface);
}

TEST(Objects, M5HexagonScrew) {
  const Object o = m5_hexagon_screw();
  EXPECT_EQ(o.height_mm(0, 3.8), 0);
  EXPECT_EQ(o.height_mm(0, 4.01), kNoSurface);
  EXPECT_GT(o.height_mm(4.5, 0), 0.3);
}

TEST(Objects, SetScrewsHaveThreads) {
  const Object o = three_set_screws();
  EXPECT_DOUBLE_EQ(o.height_mm(0, 0), 0);           // M4: a crest
  EXPECT_NEAR(o.height_mm(0.35, 0), 0.4294, 1e-4);  // half a pitch on: 0.6134 · 0.7 deep
  EXPECT_NEAR(o.height_mm(0.25, -5.5), 0.3067, 1e-4);
  EXPECT_EQ(o.height_mm(0, 3.0), kNoSurface);
}

TEST(Objects, Star) {
  const Object o = star(5);
  EXPECT_EQ(o.height_mm(0, -4.9), 0);  // a point upwards
  EXPECT_EQ(o.height_mm(0, 1.9), 0);
  EXPECT_EQ(o.height_mm(0, 2.0), kNoSurface);  // inner corner at 0.382 · 5
  EXPECT_EQ(o.height_mm(4.7, -1.53), 0);       // the next point, 72° on
}

TEST(Objects, RingAndPlugAndKey) {
  EXPECT_EQ(screw_cap().height_mm(0, 0), kNoSurface);
  EXPECT_EQ(screw_cap().height_mm(7, 0), 0);
  EXPECT_EQ(usb_c_plug().height_mm(3.3, 2.9), 0);
  EXPECT_NEAR(usb_c_plug().height_mm(0, 2.925 + 0.72), 0.24, 1e-9);  // 1.2 − √(1.2² − 0.72²)
  EXPECT_EQ(usb_c_plug().height_mm(3.4, 0), kNoSurface);
  EXPECT_EQ(key().height_mm(-7, 0), kNoSurface);
  EXPECT_EQ(key().height_mm(-4, 0), 0);
  EXPECT_EQ(key().height_mm(5, 1.4), 0.6);
}

TEST(Objects, HeightMapPressesWhitestDeepest) {
  const auto file = fakes::own_path(".png");
  base::write_file_atomically(file, image::encode_png(image::Grey8{3, 1, {0, 204, 51}}));
  const Object o = height_map(file, 0.5, 2.0);
  EXPECT_NEAR(o.height_mm(0, 0), 0, 1e-12);
  EXPECT_NEAR(o.height_mm(0.5, 0), 1.2, 1e-9);    // (204 − 51)/255 of 2 mm
  EXPECT_NEAR(o.height_mm(-0.25, 0), 0.8, 1e-9);  // half-way to black
  EXPECT_EQ(o.height_mm(0.6, 0), kNoSurface);
  std::filesystem::remove(file);
  EXPECT_THROW((void)height_map(file, 0.5, 2.0), std::exception);
}

}  // namespace
}  // namespace dtact::hal::sim
