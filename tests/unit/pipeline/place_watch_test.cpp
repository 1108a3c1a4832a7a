#include "daemon/pipeline/untouched/place_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

constexpr int kFrames = 16;

std::size_t at(int x, int y) {
  return static_cast<std::size_t>(y) * fakes::kToyWidth + static_cast<std::size_t>(x);
}

/// Coarse enough marks that eight bits show them, two levels high.
double toy_mark(int x, int y) {
  const auto hash = [](int u, int v) {
    auto h =
        static_cast<std::uint32_t>(u) * 0x9E3779B1U + static_cast<std::uint32_t>(v) * 0x85EBCA77U;
    h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;
    return static_cast<double>((h ^ (h >> 12U)) & 255U) / 128 - 1;
  };
  return 2 * hash((x + 100) / 2, y / 2);  // never negative
}

/// Of a toy sensor's layer with such marks.
std::shared_ptr<const LayerMarks> calibrated(const recon::FrameRegion& part = {
                                                 0, 0, fakes::kToyWidth, fakes::kToyHeight}) {
  std::vector<std::uint16_t> reference_q8 = fakes::toy_reference_q8();
  for (int y = 0; y < fakes::kToyHeight; ++y) {
    for (int x = 0; x < fakes::kToyWidth; ++x) {
      auto& q8 = reference_q8[at(x, y)];
      q8 = static_cast<std::uint16_t>(std::lround(q8 + 256 * toy_mark(x, y)));
    }
  }
  return std::make_shared<const LayerMarks>(reference_q8, fakes::kToyWidth, part);
}

class PlaceWatchTest : public ::testing::Test {
 protected:
  PlaceWatchTest() { watch.start(); }

  /// So many frames of a layer that lies `dx` pixels to the right of where it was at calibration.
  void show(int frames, int dx, bool untouched = true) {
    for (int i = 0; i < frames; ++i) {
      fakes::ToyFrame frame({}, sequence++);
      for (int y = 0; y < fakes::kToyHeight; ++y) {
        for (int x = 0; x < fakes::kToyWidth; ++x) {
          auto& pixel = frame.pixels[at(x, y)];
          const int moved = x < still_columns ? 0 : dx;
          pixel = static_cast<std::uint8_t>(std::lround(pixel + toy_mark(x - moved, y)));
        }
      }
      now_ns += 16'666'667;
      watch.look(frame.view(), untouched, now_ns);
    }
    watch.settle();
  }

  PlaceWatch watch{fakes::kToyWidth, fakes::kToyHeight, kFrames};
  int still_columns = 0;  ///< At the left, of what is shown.
  std::uint64_t sequence = 0;
  std::int64_t now_ns = 0;
};

TEST_F(PlaceWatchTest, TellsAMovedCameraAndHowFar) {
  watch.use_marks(calibrated());
  show(kFrames, 0);
  EXPECT_FALSE(watch.moved());
  watch.hurry();  // a new reference
  show(kFrames, 4);
  EXPECT_TRUE(watch.moved());
  EXPECT_EQ(watch.message(), "They are about 4 px right and 0 px down of there.");
  watch.hurry();
  show(kFrames, 0);
  EXPECT_FALSE(watch.moved());
}

TEST_F(PlaceWatchTest, AveragesNothingFromBeforeANewReference) {
  watch.use_marks(calibrated());
  show(kFrames - 1, 4);
  watch.hurry();
  show(1, 0);
  EXPECT_FALSE(watch.moved());
  show(kFrames - 1, 0);
  EXPECT_FALSE(watch.moved());
}

TEST_F(PlaceWatchTest, LooksOnlyWhereTheMapIs) {
  still_columns = fakes::kToyWidth / 2;
  watch.use_marks(calibrated({0, 0, fakes::kToyWidth / 2, fakes::kToyHeight}));
  show(kFrames, 4);
  EXPECT_FALSE(watch.moved());
  watch.use_marks(calibrated({fakes::kToyWidth / 2, 0, fakes::kToyWidth / 2, fakes::kToyHeight}));
  show(kFrames, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(PlaceWatchTest, LooksAgainAfterAPauseByItself) {
  watch.use_marks(calibrated());
  show(kFrames, 0);
  show(kFrames, 4);
  EXPECT_FALSE(watch.moved());
  now_ns += PlaceWatch::kPauseNs;
  show(kFrames - 1, 4);
  EXPECT_FALSE(watch.moved());
  show(1, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(PlaceWatchTest, AveragesNothingThatTouches) {
  watch.use_marks(calibrated());
  show(kFrames - 1, 4);
  show(1, 4, false);
  show(kFrames - 1, 4);
  EXPECT_FALSE(watch.moved());
  show(1, 4);
  EXPECT_TRUE(watch.moved());
}

TEST_F(PlaceWatchTest, KnowsNothingOfANewCalibrationBeforeItHasLooked) {
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
