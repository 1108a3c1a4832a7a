#include "daemon/pipeline/reference/camera_shift_detector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

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
  CameraShiftDetector halved{fakes::kToyWidth, fakes::kToyHeight, kFrames, thread, 2};
  halved.use_marks(calibrated());
  for (int i = 0; i < kFrames; ++i) {
    const fakes::ToyFrame frame({.marks = 2, .marks_px = 4}, sequence++);
    halved.look(frame.view(), true, now_ns += 16'666'667);
  }
  halved.settle();
  EXPECT_EQ(halved.message(), "They are about 8 px right and 0 px down of there.");
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
