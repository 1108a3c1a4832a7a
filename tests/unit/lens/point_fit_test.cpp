#include "clients/calibrate/lens/point_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/unit/lens/board_camera.hpp"

namespace dtact::ctl {
namespace {

/// Marks of a 7×9 board 2.5 mm apart as `camera` shows them, moved by Gaussian noise.
std::vector<Mark> marks_of(const BoardCamera& camera, double noise_px) {
  cv::RNG random(3);
  std::vector<Mark> marks;
  for (int row = -3; row <= 3; ++row) {
    for (int col = -4; col <= 4; ++col) {
      const cv::Point2d mm(2.5 * col, 2.5 * row);
      const cv::Point2d px = camera.pixel(mm);
      marks.push_back(
          {{mm.x, mm.y}, {px.x + random.gaussian(noise_px), px.y + random.gaussian(noise_px)}});
    }
  }
  return marks;
}

double worst_on_board_px(const recon::Lens& lens, const BoardCamera& camera) {
  double worst = 0;
  for (double y = -7; y <= 7; y += 1.75) {
    for (double x = -9; x <= 9; x += 2.25) {
      const recon::Point at = project(lens, {x, y});
      const cv::Point2d truth = camera.pixel({x, y});
      worst = std::max(worst, std::hypot(at.x - truth.x, at.y - truth.y));
    }
  }
  return worst;
}

BoardCamera tilted_barrel() {
  BoardCamera camera;
  camera.k1 = -0.3;
  camera.centre = {336, 228};
  camera.tilt_x = 8;
  camera.tilt_y = -5;
  return camera;
}

TEST(PointFit, FindsALensThatIsInItsFamily) {
  const BoardCamera camera = tilted_barrel();
  EXPECT_LT(worst_on_board_px(fit_lens(marks_of(camera, 0), LensModel::radial1), camera), 0.01);
  EXPECT_GT(worst_on_board_px(fit_lens(marks_of(camera, 0), LensModel::projective), camera), 1);
}

TEST(PointFit, ChoosesNoMoreThanTheMarksPayFor) {
  const ChosenLens barrel = choose_lens(marks_of(tilted_barrel(), 0.2));
  EXPECT_EQ(barrel.model, LensModel::radial1);
  EXPECT_LT(worst_on_board_px(barrel.lens, tilted_barrel()), 0.5);

  BoardCamera straight;
  EXPECT_EQ(choose_lens(marks_of(straight, 0.2)).model, LensModel::affine);
  straight.tilt_y = 20;
  EXPECT_EQ(choose_lens(marks_of(straight, 0.2)).model, LensModel::projective);
}

TEST(PointFit, LeftOutResidualsAreTheNoise) {
  // 0.2 px each way at 17.5 pixels a millimetre; the lens's own error adds a little.
  const ChosenLens chosen = choose_lens(marks_of(tilted_barrel(), 0.2));
  const double noise_mm = 0.2 * std::numbers::sqrt2 / (560.0 / 32);
  EXPECT_GT(rms(chosen.left_out), rms(chosen.in_sample));
  EXPECT_NEAR(rms(chosen.left_out), noise_mm, 0.35 * noise_mm);
}

TEST(PointFit, AMisplacedMarkIsSeenOnlyWhenLeftOut) {
  // A mark in a corner bends a lens of few marks towards itself.
  std::vector<Mark> marks = marks_of(tilted_barrel(), 0);
  marks.front().px.x += 8;  // 0.46 mm
  const auto left_out = leave_one_out(marks, LensModel::radial1);
  EXPECT_GT(std::hypot(left_out.front().x, left_out.front().y), 0.4);
  EXPECT_LT(std::hypot(left_out[31].x, left_out[31].y), 0.1);
}

TEST(PointFit, ResidualsAreMillimetresOnTheSurface) {
  recon::Lens lens;
  lens.homography = {20, 0, 5, 0, 10, 4, 0, 0, 1};  // 20 and 10 pixels a millimetre
  const Mark mark{{1, 2}, {25 + 2.0, 24 - 3.0}};
  const auto residuals = residuals_mm(lens, {&mark, 1});
  EXPECT_NEAR(residuals[0].x, 0.1, 1e-9);
  EXPECT_NEAR(residuals[0].y, -0.3, 1e-9);
  EXPECT_NEAR(rms(residuals), std::sqrt(0.01 + 0.09), 1e-9);
}

TEST(PointFit, LevelTakesOutTheRotation) {
  BoardCamera camera;
  camera.turn = 25;
  std::vector<Mark> marks = marks_of(camera, 0);
  recon::Lens lens = fit_lens(marks, LensModel::projective);
  level(lens, marks);
  const recon::Point at = project(lens, {0, 0});
  const recon::Point right = project(lens, {1, 0});
  EXPECT_NEAR(right.y, at.y, 1e-3);
  EXPECT_GT(right.x, at.x);
  for (const Mark& mark : marks) {  // the marks turn with the axes
    EXPECT_NEAR(project(lens, mark.mm).x, mark.px.x, 1e-3);
    EXPECT_NEAR(project(lens, mark.mm).y, mark.px.y, 1e-3);
  }
}

TEST(PointFit, ADifferenceWithinItsScatterIsNotClear) {
  const std::vector<double> some{1, 2, 1, 2, 1, 2};
  const std::vector<double> scattered{2, 1, 2.2, 1, 2, 1.2};
  const std::vector<double> higher{2, 3, 2.1, 3, 2, 3.1};
  EXPECT_FALSE(clearly_lower(some, scattered));
  EXPECT_TRUE(clearly_lower(some, higher));
  EXPECT_FALSE(clearly_lower(higher, some));
}

// The board's corners are at 0.39 of the distance; a lens of k1 = -2 folds at 0.41.
TEST(PointFit, FindsALensThatFoldsJustBeyondTheMarks) {
  BoardCamera camera;
  camera.k1 = -2;
  EXPECT_LT(worst_on_board_px(fit_lens(marks_of(camera, 0), LensModel::radial1), camera), 0.01);
  EXPECT_EQ(choose_lens(marks_of(camera, 0.2)).model, LensModel::radial1);
}

TEST(PointFit, RefusesWhatTheSolverCannotFit) {
  std::vector<Mark> marks = marks_of(tilted_barrel(), 0);
  marks.front().px.x = NAN;
  for (const LensModel model : {LensModel::projective, LensModel::radial1}) {
    EXPECT_THROW((void)fit_lens(marks, model), std::runtime_error);
  }
}

TEST(PointFit, RefusesTooFewMarks) {
  const std::vector<Mark> marks(5);
  EXPECT_THROW((void)fit_lens(marks, LensModel::affine), std::runtime_error);
  EXPECT_THROW((void)choose_lens(marks), std::runtime_error);
}

TEST(PointFit, RefusesMarksOnALine) {
  std::vector<Mark> marks;
  for (int i = 0; i < 12; ++i) marks.push_back({{i * 1.0, 0}, {i * 20.0, 100}});
  EXPECT_THROW((void)choose_lens(marks), std::runtime_error);
}

}  // namespace
}  // namespace dtact::ctl
