#include "daemon/recon/lens.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace dtact::recon {
namespace {

/// 20 pixels a millimetre, the origin at (5, 4), distortion about (5, 4): computed by hand below.
Lens sample() {
  Lens lens;
  lens.homography = {20, 0, 5, 0, 20, 4, 0, 0, 1};
  lens.centre_col = 5;
  lens.centre_row = 4;
  lens.radius_px = 10;
  return lens;
}

TEST(Lens, ProjectsAsItsFormulaSays) {
  Lens lens = sample();
  EXPECT_DOUBLE_EQ(project(lens, {0.5, -0.25}).x, 15);
  EXPECT_DOUBLE_EQ(project(lens, {0.5, -0.25}).y, -1);
  // 10 px right of the centre: rho = 1, so 10 (1 + 0.1 + 0.02) = 11.2; 5 px: 5 (1 + 0.025 +
  // 0.00125).
  lens.radial = {0.1, 0.02};
  EXPECT_NEAR(project(lens, {0.5, 0}).x, 16.2, 1e-12);
  EXPECT_NEAR(project(lens, {0.25, 0}).x, 10.13125, 1e-12);
  EXPECT_NEAR(project(lens, {0, 0.5}).y, 15.2, 1e-12);
  // Perspective: (20 * 0.5 + 5 * (1 + 0.2 * 0.5)) / 1.1 without distortion.
  lens = sample();
  lens.homography = {21, 0, 5, 0.8, 20, 4, 0.2, 0, 1};
  EXPECT_NEAR(project(lens, {0.5, 0}).x, 15.5 / 1.1, 1e-12);
  EXPECT_NEAR(project(lens, {0.5, 0}).y, 4.4 / 1.1, 1e-12);
}

TEST(Lens, SeesNothingBeyondTheFoldOrBehindTheCamera) {
  Lens lens = sample();
  // rho (1 - 0.5 rho^2) is greatest at rho = sqrt(2/3): 8.16 px.
  lens.radial = {-0.5};
  EXPECT_FALSE(std::isnan(project(lens, {0.40, 0}).x));
  EXPECT_TRUE(std::isnan(project(lens, {0.41, 0}).x));
  lens = sample();
  lens.homography[6] = -1;  // w = 1 - x
  EXPECT_TRUE(std::isnan(project(lens, {1.5, 0}).x));
}

TEST(Lens, CentralScaleIsTheRootOfTheArea) {
  Lens lens = sample();
  EXPECT_NEAR(central_mm_per_px(lens), 0.05, 1e-9);
  lens.homography[0] = 80;  // 80 x 20 px: 40 on average
  EXPECT_NEAR(central_mm_per_px(lens), 0.025, 1e-9);
}

TEST(Lens, APointIsSeenByThePixelThatShowsIt) {
  const MapPlace place{7, -3, 40, 30, 0.04};
  const Point mm = surface_point(sample(), place, 11.5, 2.25);
  const Point pixel = map_pixel(sample(), place, mm);
  EXPECT_NEAR(pixel.x, 11.5, 1e-9);
  EXPECT_NEAR(pixel.y, 2.25, 1e-9);
  EXPECT_NEAR(map_pixel(sample(), place, {mm.x + 0.04, mm.y}).x, 12.5, 1e-9);
}

// A mistake that surface_point() and map_pixel() share does not show when one undoes the other.
TEST(Lens, AMapsPixelLiesItsColumnsAndRowsFromTheOrigin) {
  const MapPlace place{7, -3, 40, 30, 0.04};
  const Point mm = surface_point(sample(), place, 11.5, 2.25);
  EXPECT_NEAR(mm.x, 0.54, 1e-12);   // (7 + 11.5 − 5) · 0.04
  EXPECT_NEAR(mm.y, -0.19, 1e-12);  // (−3 + 2.25 − 4) · 0.04
  EXPECT_NEAR(map_pixel(sample(), place, {0.54, -0.11}).y, 4.25, 1e-9);
}

TEST(Lens, TheAxisFootIsSeenAtTheCentreOfDistortion) {
  Lens lens = sample();
  lens.homography = {20, 10, 5, -10, 20, 4, 0, 0, 1};
  // (2, −1) mm: 40 − 10 + 5 and −20 − 20 + 4.
  lens.centre_col = 35;
  lens.centre_row = -36;
  EXPECT_NEAR(axis_foot(lens).x, 2, 1e-12);
  EXPECT_NEAR(axis_foot(lens).y, -1, 1e-12);
  // The same point under perspective: divided by 1 + 0.2 − 0.05.
  lens.homography[6] = 0.1;
  lens.homography[7] = 0.05;
  lens.centre_col = 35 / 1.15;
  lens.centre_row = -36 / 1.15;
  EXPECT_NEAR(axis_foot(lens).x, 2, 1e-12);
  EXPECT_NEAR(axis_foot(lens).y, -1, 1e-12);
}

TEST(Lens, TableHoldsPlaceAndWeights) {
  // A map of 0.1 mm a pixel reads every second pixel of the frame; the origin stays at (5, 4).
  std::vector<std::uint8_t> outside;
  const RectifyTable table = make_lens_table(sample(), 12, 9, {2, 3, 4, 2, 0.1}, outside);
  ASSERT_EQ(table.entries.size(), 8U);
  // Map pixel (0, 0) is rectified pixel (2, 3): -0.3 mm, -0.1 mm, frame pixel (-1, 2): not seen.
  EXPECT_EQ(outside, (std::vector<std::uint8_t>{1, 0, 0, 0, 1, 0, 0, 0}));
  EXPECT_EQ(table.entries[0].x, 0);
  EXPECT_EQ(table.entries[1].x, 1);
  EXPECT_EQ(table.entries[1].fx, 0);
  EXPECT_EQ(table.entries[1].y, 2);
  EXPECT_EQ(table.entries[7].x, 5);
  EXPECT_EQ(table.entries[7].y, 4);
  // 0.0625 mm a pixel are 1.25 frame pixels: a quarter is 32 of 128.
  const RectifyTable fine = make_lens_table(sample(), 12, 9, {6, 4, 1, 1, 0.0625}, outside);
  EXPECT_EQ(fine.entries[0].x, 6);
  EXPECT_EQ(fine.entries[0].fx, 32);
  EXPECT_EQ(fine.entries[0].fy, 0);
}

TEST(Lens, LastColumnIsReachedWithTheFullWeight) {
  std::vector<std::uint8_t> outside;
  const RectifyTable table = make_lens_table(sample(), 12, 9, {11, 8, 1, 1, 0.05}, outside);
  EXPECT_EQ(outside, std::vector<std::uint8_t>{0});
  EXPECT_EQ(table.entries[0].x, 10);
  EXPECT_EQ(table.entries[0].fx, 128);
  EXPECT_EQ(table.entries[0].y, 7);
  EXPECT_EQ(table.entries[0].fy, 128);
}

TEST(Lens, BesideTheFramesLastPixelNothingIsSeen) {
  // Rectified and frame pixels are the same here, without rounding; the frame has 12×9.
  Lens lens = sample();
  lens.homography = {16, 0, 5, 0, 16, 4, 0, 0, 1};
  std::vector<std::uint8_t> outside;
  (void)make_lens_table(lens, 12, 9, {11, 8, 2, 2, 0.0625}, outside);
  EXPECT_EQ(outside, (std::vector<std::uint8_t>{0, 1, 1, 1}));
  (void)make_lens_table(lens, 12, 9, {-1, -1, 2, 2, 0.0625}, outside);
  EXPECT_EQ(outside, (std::vector<std::uint8_t>{1, 1, 1, 0}));
}

TEST(Lens, RefusesWhatNoCameraSees) {
  Lens lens = sample();
  EXPECT_NO_THROW(check(lens, 12, 9));
  EXPECT_THROW(check(lens, 5, 9), std::invalid_argument);
  lens.homography[0] = -20;
  EXPECT_THROW(check(lens, 12, 9), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::recon
