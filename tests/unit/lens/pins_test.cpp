#include "clients/calibrate/lens/pins.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>
#include <stdexcept>
#include <utility>

#include "tests/unit/lens/board_camera.hpp"

namespace dtact::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A board of pins pressed into a surface under uneven light.
struct Scene {
  BoardCamera camera;
  Board board;
  double depth_levels = 20;
  double turn = 0;                              ///< Rotation of the board in its plane, degrees.
  std::set<std::pair<int, int>> missing;        ///< Row, column.
  std::set<std::pair<int, int>> astray;         ///< Half a millimetre right of their places.
  std::function<bool(cv::Point2d mm)> is_dark;  ///< Where a fiftieth of the light is left.

  Scene() {
    // Small, because the cost of finding a pin grows with its pixels.
    camera.width = 400;
    camera.height = 300;
    camera.focal = 350;
    camera.centre = {200, 150};
    camera.k1 = -0.15;
    camera.tilt_x = 2;
  }

  [[nodiscard]] cv::Point2d pin(int row, int col) const {
    const cv::Point2d flat((col - 0.5 * (board.cols - 1)) * board.pitch_mm,
                           (row - 0.5 * (board.rows - 1)) * board.pitch_mm);
    const double angle = turn * std::numbers::pi / 180;
    return {std::cos(angle) * flat.x - std::sin(angle) * flat.y,
            std::sin(angle) * flat.x + std::cos(angle) * flat.y};
  }
  [[nodiscard]] cv::Mat1f reference() const {
    return camera.photograph([&](cv::Point2d mm) { return light(mm); }, 1, 0.3);
  }
  [[nodiscard]] cv::Mat1f pressed() const {
    cv::Mat1f image = camera.photograph(
        [&](cv::Point2d mm) { return light(mm) * (1 - depth_levels / 150 * dent(mm)); }, 1, 0.3);
    if (!is_dark) return image;
    // Another exposure, as the noise is what a dark part shows: both pictures have the same grain.
    cv::Mat1f grain(image.size());
    cv::RNG(3).fill(grain, cv::RNG::NORMAL, 0, 0.4);
    image += grain;
    return image;
  }
  [[nodiscard]] PinPress find() const { return find_pins(reference(), pressed(), board); }

 private:
  /// Indentation by the nearest pin: 1 at its centre.
  [[nodiscard]] double dent(cv::Point2d mm) const {
    constexpr double kWidth = 0.45;  // mm, standard deviation of a pin's blurred dent
    const double angle = turn * std::numbers::pi / 180;
    const double along = std::cos(angle) * mm.x + std::sin(angle) * mm.y;
    const double down = std::cos(angle) * mm.y - std::sin(angle) * mm.x;
    const auto nearest = [&](double place, int count) {
      const double index = std::round(place / board.pitch_mm + 0.5 * (count - 1));
      return static_cast<int>(std::clamp(index, 0.0, count - 1.0));
    };
    const int row = nearest(down, board.rows);
    const int col = nearest(along, board.cols);
    if (missing.contains({row, col})) return 0;
    const cv::Point2d aside(astray.contains({row, col}) ? 0.5 : 0, 0);
    const cv::Point2d away = mm - pin(row, col) - aside;
    return std::exp(-away.dot(away) / (2 * kWidth * kWidth));
  }
  /// Brighter on one side, a quarter of that in the corners.
  [[nodiscard]] double light(cv::Point2d mm) const {
    const double level = 150 + 3 * mm.x - 0.25 * mm.dot(mm);
    return is_dark && is_dark(mm) ? level / 50 : level;
  }
};

/// RMS distance in pixels of the marks from where the camera shows the nearest pin.
double rms_px(const PinPress& press, const Scene& scene) {
  double sum = 0;
  for (const Mark& mark : press.marks) {
    double nearest = 1e9;
    for (int row = 0; row < scene.board.rows; ++row) {
      for (int col = 0; col < scene.board.cols; ++col) {
        const cv::Point2d truth = scene.camera.pixel(scene.pin(row, col));
        nearest = std::min(nearest, std::hypot(truth.x - mark.px.x, truth.y - mark.px.y));
      }
    }
    sum += nearest * nearest;
  }
  return std::sqrt(sum / static_cast<double>(press.marks.size()));
}

TEST(Pins, AreFoundUnderUnevenLight) {
  const Scene scene;
  const PinPress press = scene.find();
  ASSERT_EQ(press.marks.size(), 63U);
  EXPECT_EQ(press.rows, 7);
  EXPECT_EQ(press.cols, 9);
  EXPECT_LT(rms_px(press, scene), 0.3);  // 17.5 pixels a millimetre
  EXPECT_LT(rms(press.lens.left_out), 0.02);
}

TEST(Pins, AreFoundWithTheBoardTurned) {
  Scene scene;
  scene.turn = 7;
  const PinPress press = scene.find();
  ASSERT_EQ(press.marks.size(), 63U);
  EXPECT_LT(rms_px(press, scene), 0.3);
  // The axes are the picture's, not the board's: the first row's pins lie on a slope of 7 degrees.
  const auto& first = press.marks.front().mm;
  const auto& last = press.marks[8].mm;
  EXPECT_NEAR(std::atan2(last.y - first.y, last.x - first.x) * 180 / std::numbers::pi, 7, 0.3);
}

TEST(Pins, OfABoardOnEdgeHaveRowsAndColumnsSwapped) {
  Scene scene;
  scene.turn = 90;
  scene.camera.width = 300;
  scene.camera.height = 400;
  scene.camera.centre = {150, 200};
  const PinPress press = scene.find();
  ASSERT_EQ(press.marks.size(), 63U);
  EXPECT_EQ(press.rows, 9);
  EXPECT_EQ(press.cols, 7);
  EXPECT_LT(rms_px(press, scene), 0.3);
}

TEST(Pins, OfAnotherBoardAreFound) {
  Scene scene;
  scene.board = {5, 6, 3.5};
  const PinPress press = scene.find();
  ASSERT_EQ(press.marks.size(), 30U);
  EXPECT_LT(rms_px(press, scene), 0.3);
}

TEST(Pins, MissingOnesAreNamed) {
  Scene scene;
  scene.missing = {{2, 4}, {6, 8}};
  const PinPress press = scene.find();
  EXPECT_EQ(press.marks.size(), 61U);
  EXPECT_THAT(press.missing, testing::ElementsAre("row 3, column 5", "row 7, column 9"));
  EXPECT_LT(rms_px(press, scene), 0.3);
}

TEST(Pins, WhatIsFarFromItsPlaceIsNoPin) {
  Scene scene;
  scene.astray = {{1, 2}};
  const PinPress press = scene.find();
  EXPECT_EQ(press.marks.size(), 62U);
  EXPECT_THAT(press.missing, testing::ElementsAre("row 2, column 3"));
  EXPECT_LT(rms_px(press, scene), 0.3);
}

TEST(Pins, MoreThanATenthMissingIsRefused) {
  Scene scene;
  for (int col = 0; col < 7; ++col) scene.missing.insert({col % 6, col});
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("7 of 63 pins not found"), HasSubstr("row 3, column 3"))));
}

TEST(Pins, ATenthMayBeMissing) {
  Scene scene;
  scene.board = {5, 6, 3.5};
  scene.missing = {{0, 2}, {2, 4}, {4, 1}};
  const PinPress press = scene.find();
  EXPECT_EQ(press.marks.size(), 27U);
  EXPECT_THAT(press.missing,
              testing::ElementsAre("row 1, column 3", "row 3, column 5", "row 5, column 2"));
  scene.missing.insert({3, 3});
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("4 of 30 pins not found")));
}

// Half of the pins still are a board: the others are named.
TEST(Pins, HalfOfABoardIsNamed) {
  Scene scene;
  scene.board = {4, 6, 3.5};
  const std::set<std::pair<int, int>> shown = {{0, 0}, {0, 1}, {0, 2}, {0, 3}, {0, 4}, {0, 5},
                                               {1, 0}, {1, 5}, {2, 0}, {3, 0}, {3, 1}, {3, 2}};
  for (int pin = 0; pin < 24; ++pin) {
    if (!shown.contains({pin / 6, pin % 6})) scene.missing.insert({pin / 6, pin % 6});
  }
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("12 of 24 pins not found"), HasSubstr("row 4, column 6 "))));
}

// Other scales and places have lattices of which fewer pins are found than a lens has parameters.
// Before: "lens: too few points".
TEST(Pins, HasNoLatticeWhereMostPinsOfASmallBoardAreMissing) {
  Scene scene;
  scene.board = {3, 4, 3.5};
  scene.missing = {{1, 1}, {1, 2}, {1, 3}, {2, 1}, {2, 2}, {2, 3}};
  EXPECT_THAT([&] { (void)scene.find(); }, ThrowsMessage<std::runtime_error>(HasSubstr("board: ")));
}

// A lens takes twelve marks. Before: "too few points".
TEST(Pins, MissingOnesOfASmallBoardAreNamed) {
  Scene scene;
  scene.board = {3, 4, 3.5};
  scene.missing = {{1, 2}};
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("1 of 12 pins not found"), HasSubstr("row 2, column 3"))));
  scene.board = {3, 3, 3.5};
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("too few for a lens")));
}

TEST(Pins, ABoardThatIsARowShortIsRefused) {
  Scene scene;
  for (int col = 0; col < 9; ++col) scene.missing.insert({6, col});
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(AllOf(
                  HasSubstr("may lie one row off"), HasSubstr("0 of 9 pins of row 7 are found"))));
}

// The lattice fits as well one column further on: no number of pins says which is which.
TEST(Pins, AnOuterColumnInTheDarkIsRefused) {
  Scene scene;
  scene.is_dark = [](cv::Point2d mm) { return mm.x < -8.7; };
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("may lie one column off"), HasSubstr("at the left "),
                        HasSubstr("at the right "), HasSubstr("light both sides"))));
  scene.is_dark = [](cv::Point2d mm) { return mm.x > 8.7; };
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("may lie one column off")));
  scene.is_dark = [](cv::Point2d mm) { return mm.y < -6.2; };
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("may lie one row off"), HasSubstr("at the top "))));
}

// Of a long board a whole column is fewer than the tenth of the pins that may be missing.
TEST(Pins, AnOuterColumnOfALongBoardInTheDarkIsRefused) {
  Scene scene;
  scene.board = {5, 11, 1.9};
  EXPECT_EQ(scene.find().marks.size(), 55U);
  scene.is_dark = [](cv::Point2d mm) { return mm.x < -8.5; };
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("may lie one column off")));
}

TEST(Pins, NothingPressedIsNoBoard) {
  Scene scene;
  scene.depth_levels = 0;
  EXPECT_THAT([&] { (void)scene.find(); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no lattice of 7x9 pins found")));
}

}  // namespace
}  // namespace dtact::ctl
