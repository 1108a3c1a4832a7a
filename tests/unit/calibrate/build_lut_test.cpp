// LUTs of several presses with the camera's height: from the presses, a drawing or a board of pins.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/fit/camera_height.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/offline/depth_build.hpp"
#include "hal/sim/renderer.hpp"
#include "tests/unit/calibration/ball.hpp"

namespace dtact::ctl {
namespace {

using calibration::Ball;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// Presses of a ball of 4 mm on the simulated sensor, through a camera `camera_mm` above it.
class SimulatedPresses {
 public:
  struct Place {
    double x_mm = 0;
    double y_mm = 0;
    double depth_mm = 0;
  };

  SimulatedPresses(const std::vector<Place>& places, double camera_mm)
      : scene_(hal::sim::default_scene()) {
    scene_.camera.width = 500;
    scene_.camera.height = 400;
    scene_.camera.mm_per_px = 0.0417;
    scene_.surface.camera_mm = camera_mm;
    scene_.gel.solve_step_mm = 5;
    scene_.loop_to_s = 0;
    scene_.presses.clear();
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto& [x_mm, y_mm, depth_mm] = places[i];
      const auto key = [&](double time_s, double depth) {
        return hal::sim::PressKey{.time_s = time_s, .x_mm = x_mm, .y_mm = y_mm, .depth_mm = depth};
      };
      const double begin_s = begins_s(i);
      scene_.presses.push_back({hal::sim::ball(4),
                                {key(begin_s, 0), key(begin_s + 0.1, depth_mm),
                                 key(begin_s + 0.9, depth_mm), key(begin_s + 1, 0)}});
    }
    hal::sim::Renderer renderer(scene_, 1);
    const auto take = [&](double time_s, int count) {
      std::vector<image::Grey8> frames;
      const auto first = static_cast<std::uint64_t>(time_s * scene_.camera.fps);
      for (int i = 0; i < count; ++i) {
        image::Grey8& frame = frames.emplace_back(image::Grey8{500, 400, {}});
        frame.pixels.resize(500UL * 400);
        renderer.render(first + static_cast<std::uint64_t>(i), hal::sim::led_levels({}),
                        frame.pixels.data(), 500, 400);
      }
      return frames;
    };
    set_.ball_radius_mm = 4;
    set_.mm_per_px = 0.0417;
    set_.view = {.foot_mm = {},
                 .source = calibration::HeightSource::assumed,
                 .per_mm = calibration::kAssumedPerMm};
    set_.reference_q8 = {500, 400, std::vector<std::uint16_t>(500UL * 400)};
    for (const image::Grey8& frame : take(0, 16)) {
      for (std::size_t i = 0; i < frame.pixels.size(); ++i) {
        set_.reference_q8.pixels[i] += static_cast<std::uint16_t>(16 * frame.pixels[i]);
      }
    }
    for (std::size_t i = 0; i < places.size(); ++i) {
      set_.presses.push_back(
          {.name = std::to_string(i), .frames = take(begins_s(i) + 0.2, 8), .depth_mm = {}});
    }
  }

  [[nodiscard]] const calibration::BallPresses& set() const { return set_; }

 private:
  static double begins_s(std::size_t press) { return 0.5 + 1.5 * static_cast<double>(press); }

  hal::sim::Scene scene_;
  calibration::BallPresses set_;
};

const std::vector<SimulatedPresses::Place> kAround = {{0.4, -0.3, 1.3},  {6.5, 3.8, 0.8},
                                                      {-6.8, -2.5, 1.0}, {2.5, -4.6, 0.6},
                                                      {-4.4, 4.2, 1.1},  {5.1, -4.4, 0.5}};

TEST(BuildLut, PressesShowTheCamerasHeight) {
  // Six of unknown depth calibrate. The last is 1 mm deep, 8 mm off the axis.
  std::vector<SimulatedPresses::Place> places = kAround;
  places.push_back({-6.4, -4.8, 1.0});
  PressImages images{.set = SimulatedPresses(places, 20).set(), .gain = {}, .origin = {}};
  const calibration::BallPresses::Press judged = std::move(images.set.presses.back());
  images.set.presses.pop_back();
  calibration::PressReport report;
  const auto off_mm = [&](const calibration::Calibration& made) {
    const calibration::Evaluation read = calibration::read_ball(
        made, images.set.reference_q8.pixels, judged.frames, images.set.ball_radius_mm);
    return std::hypot((read.contact.col - 249.5) * 0.0417 + 6.4,
                      (read.contact.row - 199.5) * 0.0417 + 4.8);
  };
  const calibration::Calibration shown = build_lut(images, FitMethod::alone, &report);
  EXPECT_EQ(shown.view.source, calibration::HeightSource::presses);
  EXPECT_NEAR(shown.view.per_mm, 1.0 / 20, 2 * shown.view.error);
  EXPECT_LT(shown.view.error, 0.007);
  EXPECT_THAT(report.note, HasSubstr("mm above the surface (as the presses show)"));
  EXPECT_LT(off_mm(shown), 0.03);

  // A drawing comes first; here it is wrong.
  images.set.view.source = calibration::HeightSource::drawing;
  EXPECT_GT(off_mm(build_lut(images, FitMethod::alone, &report)), 2 * off_mm(shown));
  EXPECT_THAT(report.note, HasSubstr("camera: 30.0 mm above the surface (as the drawing says)"));

  images.set.view.source = calibration::HeightSource::assumed;
  images.set.presses.resize(3);
  EXPECT_EQ(calibration::view_of_presses(images.set), images.set.view);
}

// The board's grey levels need a LUT to become a height, and these presses alone make none.
TEST(BuildLut, AGelMakesUpForAPressWithTheLensOfABoard) {
  PressImages images{.set = SimulatedPresses({{0.4, -0.3, 1.3}, {-4.4, 4.2, 1.1}}, 20).set(),
                     .gain = {},
                     .origin = {}};
  images.set.view = {.foot_mm = {},
                     .source = calibration::HeightSource::board,
                     .per_mm = 0,
                     .per_level = 0.0015,
                     .error = 0.0001};
  for (const FitMethod method : {FitMethod::automatic, FitMethod::model}) {
    EXPECT_EQ(build_lut(images, method, nullptr).view.source, calibration::HeightSource::board);
  }
  EXPECT_THAT([&] { (void)build_lut(images, FitMethod::alone, nullptr); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no press shows")));
}

TEST(BuildLut, NamesTheMissingPressWhereNoGelMakesUpForIt) {
  // No gel has a ring like that of these pictures.
  const Ball deep{.depth_mm = 1.5};
  PressImages images{.set = {}, .gain = {}, .origin = {}};
  images.set.reference_q8 = deep.reference_image_q8();
  images.set.presses = {
      {.name = "deep", .frames = {deep.frame()}, .depth_mm = {}},
      {.name = "other", .frames = {Ball{.depth_mm = 1.4}.frame()}, .depth_mm = {}}};
  images.set.ball_radius_mm = 4;
  images.set.mm_per_px = 0.05;
  images.set.view = {.foot_mm = {},
                     .source = calibration::HeightSource::board,
                     .per_mm = 0,
                     .per_level = 0.0015,
                     .error = 0.0001};
  EXPECT_THAT([&] { (void)build_lut(images, FitMethod::automatic, nullptr); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no press shows")));
}

}  // namespace
}  // namespace dtact::ctl
