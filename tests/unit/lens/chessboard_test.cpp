#include "clients/calibrate/lens/chessboard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/lens/board_camera.hpp"

namespace dtact::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr Chessboard kBoard{9, 7, 3.0};

/// The board, its middle at the plane's origin, on a light ground.
double squares(cv::Point2d mm) {
  const double col = mm.x / kBoard.square_mm + 0.5 * kBoard.cols;
  const double row = mm.y / kBoard.square_mm + 0.5 * kBoard.rows;
  if (col < 0 || row < 0 || col >= kBoard.cols || row >= kBoard.rows) return 210;
  return (static_cast<int>(col) + static_cast<int>(row)) % 2 == 0 ? 40 : 210;
}

cv::Mat1b photograph(const BoardCamera& camera) {
  cv::Mat1b image;
  camera.photograph(squares, 3, 1.0).convertTo(image, CV_8U);
  return image;
}

/// A barrel lens over a board that is slightly tilted.
BoardCamera flat() {
  BoardCamera camera;
  camera.k1 = -0.20;
  camera.k2 = 0.06;
  camera.centre = {328, 232};
  camera.tilt_x = 3;
  return camera;
}

/// The greatest distance in pixels between the lens's and the camera's positions of the board's
/// inside. A board that is turned about its own x axis only is level.
double worst_px(const recon::Lens& lens, const BoardCamera& camera) {
  double worst = 0;
  for (double y = -7.5; y <= 7.5; y += 2.5) {
    for (double x = -10.5; x <= 10.5; x += 3.5) {
      const recon::Point at = project(lens, {x, y});
      const cv::Point2d truth = camera.pixel({x, y});
      worst = std::max(worst, std::hypot(at.x - truth.x, at.y - truth.y));
    }
  }
  return worst;
}

/// A calibration from the board as `camera` shows it and five more images of it tilted.
ChessboardLens calibrate_tilted(const BoardCamera& camera) {
  std::vector<cv::Mat1b> images{photograph(camera)};
  std::vector<std::string> names{"flat.png"};
  for (const auto& [x, y] : {std::pair{25., 0.}, {-22., 8.}, {0., 25.}, {6., -24.}, {18., 18.}}) {
    BoardCamera tilted = camera;
    tilted.tilt_x = x;
    tilted.tilt_y = y;
    tilted.turn = x - y;
    tilted.distance_mm = 36;
    images.push_back(photograph(tilted));
    names.push_back("tilted.png");
  }
  return calibrate_chessboards(images, names, kBoard);
}

TEST(ChessboardLens, OneImageGivesTheLens) {
  const ChessboardLens made = calibrate_chessboards({photograph(flat())}, {"flat.png"}, kBoard);
  EXPECT_EQ(made.marks.size(), 48U);
  EXPECT_LT(worst_px(made.lens.lens, flat()), 0.3);
  EXPECT_LT(rms(made.lens.left_out), 0.01);  // mm: a fifth of a pixel
  EXPECT_GE(made.lens.model, LensModel::radial1);
}

TEST(ChessboardLens, TiltedImagesGiveTheLensOfTheFirst) {
  const ChessboardLens made = calibrate_tilted(flat());
  EXPECT_LT(worst_px(made.lens.lens, flat()), 0.3);
  EXPECT_LT(rms(made.lens.left_out), 0.01);
}

TEST(ChessboardLens, AStrongLensHasThreeTerms) {
  BoardCamera camera = flat();
  camera.k3 = -1.2;
  const ChessboardLens made = calibrate_tilted(camera);
  EXPECT_EQ(made.lens.model, LensModel::radial3);
  EXPECT_LT(worst_px(made.lens.lens, camera), 0.3);
}

TEST(ChessboardLens, WhatIsRightOnTheSurfaceIsRightInTheLens) {
  for (const double turn : {90, 180}) {
    BoardCamera camera;
    camera.width = 480;
    camera.turn = turn;
    camera.centre = {240, 240};
    camera.focal = 420;
    const ChessboardLens made = calibrate_chessboards({photograph(camera)}, {"flat.png"}, kBoard);
    const recon::Point at = project(made.lens.lens, {0, 0});
    EXPECT_GT(project(made.lens.lens, {1, 0}).x, at.x + 5) << turn;
    EXPECT_GT(project(made.lens.lens, {0, 1}).y, at.y + 5) << turn;
  }
}

TEST(ChessboardLens, AStraightPictureNeedsNoRadialTerm) {
  BoardCamera camera;
  camera.tilt_x = 5;
  const ChessboardLens made = calibrate_chessboards({photograph(camera)}, {"flat.png"}, kBoard);
  EXPECT_TRUE(made.lens.lens.radial.empty());
  EXPECT_LT(worst_px(made.lens.lens, camera), 0.2);
}

TEST(ChessboardLens, NamesTheImageWithoutABoard) {
  BoardCamera away = flat();
  away.shift_mm = {14, 0};  // half outside
  const cv::Mat1b whole = photograph(flat());
  const std::vector<cv::Mat1b> images{whole, photograph(away), whole, whole};
  EXPECT_THAT(
      [&] { (void)calibrate_chessboards(images, {"a.png", "b.png", "c.png", "d.png"}, kBoard); },
      ThrowsMessage<std::runtime_error>(
          AllOf(HasSubstr("b.png"), HasSubstr("no chessboard of 9x7 squares"))));
}

TEST(ChessboardLens, RefusesTwoImages) {
  const cv::Mat1b image(60, 80, 128);
  EXPECT_THAT([&] { (void)calibrate_chessboards({image, image}, {"a.png", "b.png"}, kBoard); },
              ThrowsMessage<std::runtime_error>(HasSubstr("at least 3 of the same board tilted")));
}

TEST(ChessboardLens, RefusesABoardOfThreeSquares) {
  EXPECT_THAT([] { (void)calibrate_chessboards({cv::Mat1b(60, 80, 128)}, {"a.png"}, {3, 7, 3.0}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("at least 4x4 squares")));
}

}  // namespace
}  // namespace dtact::ctl
