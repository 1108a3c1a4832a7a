// Calibrations by the gel's model from images that the model itself computes.
#include "clients/calibrate/fit/model/model_build.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "tests/unit/calibrate/predicted_press.hpp"

namespace dtact::calibration {
namespace {

BallPresses presses_of(const ImaginedView& view) {
  BallPresses set;
  set.reference_q8 = view.reference_image_q8();
  set.presses = {{.name = "ball", .frames = {view.frame()}, .depth_mm = {}}};
  set.ball_radius_mm = view.ball_radius_mm;
  set.mm_per_px = ImaginedView::kMmPerPx;
  return set;
}

/// Greatest depth that a calibration reads, the mean over a disc of a quarter of a millimetre.
double deepest_mm(const Calibration& calibration, const ImaginedView& view) {
  const std::vector<float> um = mean_depth_um(*calibration.model, view.reference_image_q8().pixels,
                                              std::vector{view.frame()});
  const double col = view.col - calibration.crop_col;
  const double row = view.row - calibration.crop_row;
  double sum = 0;
  int count = 0;
  for (int y = 0; y < calibration.model->rectify.height; ++y) {
    for (int x = 0; x < calibration.model->rectify.width; ++x) {
      if (std::hypot(x - col, y - row) > 4) continue;
      sum += um[static_cast<std::size_t>(y) *
                    static_cast<std::size_t>(calibration.model->rectify.width) +
                static_cast<std::size_t>(x)];
      ++count;
    }
  }
  return 0.001 * sum / count;
}

// The light grows by 1.2 % a millimetre, and darkening is a share of it.
TEST(ModelBuild, ABoardThatAskedForNoGainIsBelieved) {
  ImaginedView view;
  view.light = [](int x, int) { return 160 * (1 + 0.012 * ImaginedView::kMmPerPx * (x - 200)); };
  BallPresses set = presses_of(view);
  EXPECT_EQ(build_model(set).calibration.model->gain.shape, recon::GainShape::uniform);
  set.gain_specified = true;
  EXPECT_EQ(build_model(set).calibration.model->gain.shape, recon::GainShape::none);
}

TEST(ModelBuild, AGainStaysAtItsPlaceOnTheSurface) {
  ImaginedView view;
  view.col = 130;
  const recon::FlatFieldGain on_surface{.polynomial = {0, 0, 0.004, 0.001, 0.002}};
  // The camera shows the middle of the lens's board at column 250, row 180.
  const auto gain_at = [&](double x, double y) {
    return on_surface.polynomial_at((x - 250) * ImaginedView::kMmPerPx,
                                    (y - 180) * ImaginedView::kMmPerPx);
  };
  view.gain = gain_at;
  BallPresses set = presses_of(view);
  set.lens = recon::Lens{};
  set.lens->homography = {
      1 / ImaginedView::kMmPerPx, 0, 250, 0, 1 / ImaginedView::kMmPerPx, 180, 0, 0, 1};
  set.crop = Crop{10, 20, 280, 300};
  const FittedCalibration made = build_model(set, on_surface);
  const recon::FlatFieldGain& gain = made.calibration.model->gain;
  const auto on_map = [&](double x, double y) {
    return gain.polynomial_at((x - 10 - 139.5) * ImaginedView::kMmPerPx,
                              (y - 20 - 149.5) * ImaginedView::kMmPerPx);
  };
  for (const double x : {30.0, 130.0, 270.0}) {
    for (const double y : {40.0, 180.0, 300.0}) {
      EXPECT_NEAR(on_map(x, y) / on_map(130, 180), gain_at(x, y) / gain_at(130, 180), 1e-3)
          << x << ", " << y;
    }
  }
  ImaginedView beside = view;
  beside.col = 210;
  EXPECT_NEAR(deepest_mm(made.calibration, beside), deepest_mm(made.calibration, view), 0.02);
}

TEST(ModelBuild, RefusesWhatIsWhiteOrBlack) {
  using testing::HasSubstr;
  using testing::ThrowsMessage;
  const BallPresses set = presses_of({});
  BallPresses white = set;  // of a light of 260 levels
  std::ranges::fill(white.reference_q8.pixels, std::uint16_t{255 * 256});
  for (auto& pixel : white.presses[0].frames[0].pixels) {
    pixel = static_cast<std::uint8_t>(std::min(255, pixel + 100));
  }
  EXPECT_THAT([&] { (void)build_model(white); },
              ThrowsMessage<std::runtime_error>(HasSubstr("ball: the reference is white")));
  BallPresses black = set;
  for (auto& pixel : black.presses[0].frames[0].pixels) pixel = pixel < 140 ? 0 : pixel;
  EXPECT_THAT([&] { (void)build_model(black); },
              ThrowsMessage<std::runtime_error>(HasSubstr("image is black at the contact")));
}

}  // namespace
}  // namespace dtact::calibration
