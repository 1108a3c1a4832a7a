#include "daemon/pipeline/reference/camera_shift_detector.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

using testing::MatchesRegex;

constexpr int kFrames = 16;

/// Marks of a toy sensor's gel, two levels high.
std::shared_ptr<const GelMarks> calibrated(const recon::FrameRegion& part = {0, 0, fakes::kToyWidth,
                                                                             fakes::kToyHeight}) {
  return std::make_shared<const GelMarks>(fakes::toy_reference_q8({.marks = 2}), fakes::kToyWidth,
                                          part);
}

class CameraShiftDetectorTest : public ::testing::Test {
 protected:
  CameraShiftDetectorTest() { thread.start(); }

  /// Shows `frames` frames of a gel that is `dx` pixels right of its position at calibration.
  void show(int frames, int dx, bool no_contact = true) {
    for (int i = 0; i < frames; ++i) {
      fakes::ToyFrame frame({.marks = 2, .marks_px = dx}, sequence);
      const fakes::ToyFrame still({.marks = 2}, sequence++);
      for (int y = 0; y < fakes::kToyHeight; ++y) {
        const std::ptrdiff_t row = std::ptrdiff_t{y} * fakes::kToyWidth;
        std::copy_n(still.pixels.begin() + row, still_columns, frame.pixels.begin() + row);
      }
      now_ns += 16'666'667;
      watch.look(frame.view(), no_contact, now_ns);
    }
    watch.settle();
  }

  base::BackgroundThread thread{"side"};
  CameraShiftDetector watch{fakes::kToyWidth, fakes::kToyHeight, kFrames, thread};
  int still_columns = 0;  ///< Columns at the left that do not move.
  std::uint64_t sequence = 0;
  std::int64_t now_ns = 0;
};

TEST_F(CameraShiftDetectorTest, ReportsAMovedCameraAndHowFar) {
  watch.use_marks(calibrated());
  show(kFrames, 0);
  EXPECT_FALSE(watch.moved());
  watch.check_now();  // a new reference
  show(kFrames, 4);
  EXPECT_TRUE(watch.moved());
  EXPECT_EQ(watch.message(), "They are about 4 px right and 0 px down of there.");
  watch.check_now();
  show(kFrames, 0);
  EXPECT_FALSE(watch.moved());
}

// A person measures in the camera's own picture.
TEST_F(CameraShiftDetectorTest, CountsPixelsOfTheJpegs) {
  base::BackgroundThread own{"side"};
  CameraShiftDetector halved{fakes::kToyWidth, fakes::kToyHeight, kFrames, own, 2};
  own.start();
  halved.use_marks(calibrated());
  for (int i = 0; i < kFrames; ++i) {
    const fakes::ToyFrame frame({.marks = 2, .marks_px = 4}, sequence++);
    halved.look(frame.view(), true, now_ns += 16'666'667);
  }
  halved.settle();
  EXPECT_EQ(halved.message(), "They are about 8 px right and 0 px down of there.");
}

/// The gel's marks as spots of 60 levels, shifted and turned about the middle of 400×300 pixels.
std::vector<std::uint8_t> spots(double dx, double dy, double turn_deg) {
  constexpr int kSpotsWidth = 400;
  constexpr int kSpotsHeight = 300;
  std::vector<double> grey(std::size_t{kSpotsWidth} * kSpotsHeight, 100);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-0.6, 0.6);
  const double turn = turn_deg * std::numbers::pi / 180;
  for (int i = 0; i < 500; ++i) {
    const double u = place(random) * kSpotsWidth;
    const double v = place(random) * kSpotsHeight;
    const double cx = kSpotsWidth / 2.0 + std::cos(turn) * u - std::sin(turn) * v + dx;
    const double cy = kSpotsHeight / 2.0 + std::sin(turn) * u + std::cos(turn) * v + dy;
    for (int y = std::max(0, static_cast<int>(cy) - 5);
         y < std::min(kSpotsHeight, static_cast<int>(cy) + 6); ++y) {
      for (int x = std::max(0, static_cast<int>(cx) - 5);
           x < std::min(kSpotsWidth, static_cast<int>(cx) + 6); ++x) {
        grey[static_cast<std::size_t>(y * kSpotsWidth + x)] +=
            60 * std::exp(-(std::pow(x - cx, 2) + std::pow(y - cy, 2)) / 4.5);
      }
    }
  }
  std::vector<std::uint8_t> pixels;
  for (const double level : grey) {
    pixels.push_back(static_cast<std::uint8_t>(std::min(level, 255.0)));
  }
  return pixels;
}

TEST_F(CameraShiftDetectorTest, NamesTheDirectionAndTheTurn) {
  std::vector<std::uint16_t> then_q8;
  for (const std::uint8_t level : spots(0, 0, 0)) {
    then_q8.push_back(static_cast<std::uint16_t>(level * 256));
  }
  const auto then =
      std::make_shared<const GelMarks>(then_q8, 400, recon::FrameRegion{0, 0, 400, 300});
  const auto message = [&](double dx, double dy, double turn_deg) {
    base::BackgroundThread own{"side"};  // a thread gets its jobs before it starts
    CameraShiftDetector detector{400, 300, 1, own};
    own.start();
    detector.use_marks(then);
    const std::vector<std::uint8_t> now = spots(dx, dy, turn_deg);
    detector.look({now.data(), 400, 300, 400}, true, 0);
    detector.settle();
    EXPECT_TRUE(detector.moved());
    return detector.message();
  };
  // Within a pixel and half a degree of what is true.
  EXPECT_THAT(message(-7, -4, 0), MatchesRegex("They are about [678] px left and [345] px up of "
                                               "there."));
  EXPECT_THAT(message(5, 9, 0), MatchesRegex("They are about [456] px right and ([89]|10) px down "
                                             "of there."));
  EXPECT_THAT(message(-6, 3, -2),
              MatchesRegex("They are about [567] px left and [234] px down of there, turned by "
                           "(1.5|1.75|2|2.25|2.5) degrees anticlockwise."));
  EXPECT_THAT(message(6, -3, 2),
              MatchesRegex("They are about [567] px right and [234] px up of there, turned by "
                           "(1.5|1.75|2|2.25|2.5) degrees clockwise."));
}

TEST_F(CameraShiftDetectorTest, AveragesNothingFromBeforeANewReference) {
  watch.use_marks(calibrated());
  show(kFrames - 1, 4);
  watch.check_now();
  show(1, 0);
  EXPECT_FALSE(watch.moved());
  show(kFrames - 1, 0);
  EXPECT_FALSE(watch.moved());
}

TEST_F(CameraShiftDetectorTest, LooksOnlyWhereTheMapIs) {
  still_columns = fakes::kToyWidth / 2;
  watch.use_marks(calibrated({0, 0, fakes::kToyWidth / 2, fakes::kToyHeight}));
  show(kFrames, 4);
  EXPECT_FALSE(watch.moved());
  watch.use_marks(calibrated({fakes::kToyWidth / 2, 0, fakes::kToyWidth / 2, fakes::kToyHeight}));
  show(kFrames, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(CameraShiftDetectorTest, LooksAgainAfterAPauseByItself) {
  watch.use_marks(calibrated());
  show(kFrames, 0);
  show(kFrames, 4);
  EXPECT_FALSE(watch.moved());
  now_ns += CameraShiftDetector::kPauseNs;
  show(kFrames - 1, 4);
  EXPECT_FALSE(watch.moved());
  show(1, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(CameraShiftDetectorTest, AveragesNothingInContact) {
  watch.use_marks(calibrated());
  show(kFrames - 1, 4);
  show(1, 4, false);
  show(kFrames - 1, 4);
  EXPECT_FALSE(watch.moved());
  show(1, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(CameraShiftDetectorTest, KnowsNothingOfANewCalibrationBeforeItHasLooked) {
  show(kFrames, 4);
  EXPECT_FALSE(watch.moved());  // without any calibration
  watch.use_marks(calibrated());
  show(kFrames, 4);
  ASSERT_TRUE(watch.moved());
  watch.use_marks(calibrated());
  EXPECT_FALSE(watch.moved());
}

}  // namespace
}  // namespace dtact::pipeline
