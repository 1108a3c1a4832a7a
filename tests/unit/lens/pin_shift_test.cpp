// The camera's height from a board of pins that a camera at a known height photographs.
#include "clients/calibrate/lens/pin_shift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "clients/calibrate/lens/pins.hpp"
#include "tests/unit/lens/board_camera.hpp"

namespace dtact::ctl {
namespace {

constexpr double kMmPerLevel = 0.032;
constexpr double kTipMm = 0.48;

/// Pins of 0.6 mm radius under a camera 28 mm above (0.4, −0.3), on a gel that blurs them.
struct PressedBoard {
  BoardCamera camera;
  Board board;
  double height_mm = 28;

  PressedBoard() {
    camera.width = 500;
    camera.height = 400;
    camera.focal = 440;
    camera.centre = {255, 195};
    camera.k1 = -0.12;
    camera.distance_mm = 28;
    camera.shift_mm = {-0.4, 0.3};
  }
  [[nodiscard]] recon::Point foot() const { return {-camera.shift_mm.x, -camera.shift_mm.y}; }
  [[nodiscard]] double depth_at(recon::Point mm) const {
    const auto off = [&](double place, int count) {
      const double index = std::round(place / board.pitch_mm + 0.5 * (count - 1));
      const double nearest = std::clamp(index, 0.0, count - 1.0);
      return place - (nearest - 0.5 * (count - 1)) * board.pitch_mm;
    };
    const double x = off(mm.x, board.cols);
    const double y = off(mm.y, board.rows);
    return kTipMm * std::exp(-(x * x + y * y) / (2 * 0.42 * 0.42));
  }
  [[nodiscard]] cv::Mat1f reference() const {
    return camera.photograph([](cv::Point2d) { return 150.0; }, 1, 0.3);
  }
  [[nodiscard]] cv::Mat1f pressed() const {
    const recon::Viewpoint view{foot(), height_mm > 0 ? 1 / height_mm : 0};
    return camera.photograph(
        [&](cv::Point2d mm) {
          const recon::Point seen{mm.x, mm.y};
          double depth = 0;
          for (int round = 0; round < 6; ++round) depth = depth_at(view.place(seen, depth));
          return 150.0 - depth / kMmPerLevel;
        },
        2, 0.4);
  }
};

TEST(PinShift, IsTheCamerasHeight) {
  const PressedBoard scene;
  const cv::Mat1f reference = scene.reference();
  const cv::Mat1f pressed = scene.pressed();
  const PinPress press = find_pins(reference, pressed, scene.board);
  const PinShift shift =
      measure_pin_shift(reference, pressed, press.marks, press.lens.lens, scene.board.pitch_mm);
  ASSERT_TRUE(shift.sure()) << shift.describe();
  EXPECT_NEAR(shift.foot_mm.x, scene.foot().x, 0.1);
  EXPECT_NEAR(shift.foot_mm.y, scene.foot().y, 0.1);
  EXPECT_NEAR(shift.per_level / kMmPerLevel, 1 / scene.height_mm, 0.06 / scene.height_mm);
  // The pins' tips pass for places of the surface; where the lens shows it undeformed is farther
  // in.
  const auto worst_px = [&](const recon::Lens& lens) {
    double worst = 0;
    for (const double x : {-9.0, 9.0}) {
      for (const double y : {-7.0, 7.0}) {
        const recon::Point px = project(lens, {x, y});
        const cv::Point2d is = scene.camera.pixel({x, y});
        worst = std::max(worst, std::hypot(px.x - is.x, px.y - is.y));
      }
    }
    return worst;
  };
  EXPECT_GT(worst_px(press.lens.lens), 1.0);
  EXPECT_LT(worst_px(undeformed(press.lens.lens, shift)), 0.35);
}

TEST(PinShift, IsNotSureWhereRaysAreParallel) {
  PressedBoard scene;
  scene.height_mm = 0;
  const cv::Mat1f reference = scene.reference();
  const cv::Mat1f pressed = scene.pressed();
  const PinPress press = find_pins(reference, pressed, scene.board);
  EXPECT_FALSE(
      measure_pin_shift(reference, pressed, press.marks, press.lens.lens, scene.board.pitch_mm)
          .sure());
}

}  // namespace
}  // namespace dtact::ctl
