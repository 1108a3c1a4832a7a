#include "daemon/pipeline/reference/image_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace dtact::pipeline {
namespace {

constexpr int kWidth = 160;
constexpr int kHeight = 120;

/// A reference of grey 100 and frames that differ from it.
class ImageWatchTest : public ::testing::Test {
 protected:
  ImageWatchTest() {
    const std::vector<std::uint16_t> reference(pixels_.size(), 100 * 256);
    watch_.set_reference(reference, kWidth, kHeight, {});
    report_.cells = 80;
    report_.frame.pixels = 10240;
    report_.mean_grey = 100;
    report_.frame.rough_noise = 1;
  }

  void look() { watch_.look(report_, {pixels_.data(), kWidth, kHeight, kWidth}, light_); }
  [[nodiscard]] bool has(Health health) const { return watch_.health_flags().has(health); }

  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight, 100);
  CellReport report_;
  double light_ = 1;
  ImageWatch watch_;
};

TEST_F(ImageWatchTest, CleanPictureIsFine) {
  look();
  EXPECT_TRUE(watch_.health_flags().empty());
}

TEST_F(ImageWatchTest, LightIsComparedOnlyWhereMuchIsActive) {
  pixels_.assign(pixels_.size(), 97);  // 3 % less
  look();
  EXPECT_FALSE(has(Health::light_drifted));
  report_.active_cells = 80;
  look();
  EXPECT_TRUE(has(Health::light_drifted));
  report_.active_cells = 0;
  look();
  EXPECT_FALSE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, WhatIsFollowedIsNoDrift) {
  pixels_.assign(pixels_.size(), 97);
  report_.active_cells = 80;
  light_ = 0.97;
  look();
  EXPECT_FALSE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, PressOnAThirdIsNoDrift) {
  for (std::size_t y = 40; y < 100; ++y) {
    for (std::size_t x = 40; x < 140; ++x) pixels_[y * kWidth + x] = 80;
  }
  report_.active_cells = 30;
  look();
  EXPECT_FALSE(has(Health::light_drifted));
}

// The bulge is highest beside the press; a change of light is the same everywhere.
TEST_F(ImageWatchTest, BulgeRoundAWidePressIsNoDriftButBrighterLightIs) {
  report_.active_cells = 80;
  const auto press = [&](double bulge, double light) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double distance = std::hypot(x - 70, y - 55);
        const double grey = distance < 25 ? 80 : 100 + bulge * (1 - distance / 120);
        pixels_[static_cast<std::size_t>(y * kWidth + x)] =
            static_cast<std::uint8_t>(std::lround(light * grey));
      }
    }
    watch_.forget();
    look();
  };
  press(9, 1);
  EXPECT_FALSE(has(Health::light_drifted));
  press(0, 1.03);
  EXPECT_TRUE(has(Health::light_drifted));
  press(9, 0.9);
  EXPECT_TRUE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, LightIsLookedAtEverySixteenFrames) {
  report_.active_cells = 80;
  look();
  pixels_.assign(pixels_.size(), 90);
  for (int i = 1; i < 16; ++i) look();
  EXPECT_FALSE(has(Health::light_drifted));
  look();
  EXPECT_TRUE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, LightIsComparedFromAQuarterOfTheCellsOn) {
  pixels_.assign(pixels_.size(), 90);
  report_.active_cells = 19;  // of 80
  look();
  EXPECT_FALSE(has(Health::light_drifted));
  report_.active_cells = 20;
  look();
  EXPECT_TRUE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, AQuarterMoreActiveCellsAreLookedAtAtOnce) {
  report_.active_cells = 20;
  look();
  pixels_.assign(pixels_.size(), 90);
  report_.active_cells = 39;
  look();
  EXPECT_FALSE(has(Health::light_drifted));
  report_.active_cells = 40;
  look();
  EXPECT_TRUE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, LightThatChangesUnderAPressIsLookedAtAtOnce) {
  report_.active_cells = 30;
  look();
  pixels_.assign(pixels_.size(), 90);
  report_.active_cells = 80;
  look();
  EXPECT_TRUE(has(Health::light_drifted));
}

TEST_F(ImageWatchTest, BandsMustLastSixFrames) {
  report_.frame.ripple = 0.6;
  for (int i = 0; i < 5; ++i) look();
  EXPECT_FALSE(has(Health::light_banded));
  look();
  EXPECT_TRUE(has(Health::light_banded));
  watch_.forget();
  EXPECT_TRUE(watch_.health_flags().empty());
}

// The same after bands of any length.
TEST_F(ImageWatchTest, BandsAreOverSevenFramesAfterTheLast) {
  report_.frame.ripple = 0.6;
  for (int i = 0; i < 100; ++i) look();
  report_.frame.ripple = 0;
  for (int i = 0; i < 6; ++i) look();
  EXPECT_TRUE(has(Health::light_banded));
  look();
  EXPECT_FALSE(has(Health::light_banded));
}

TEST_F(ImageWatchTest, RipplesUpToHalfALevelAreNoBands) {
  report_.frame.ripple = 0.5;
  for (int i = 0; i < 12; ++i) look();
  EXPECT_FALSE(has(Health::light_banded));
  report_.frame.ripple = 0.51;
  for (int i = 0; i < 6; ++i) look();
  EXPECT_TRUE(has(Health::light_banded));
}

TEST_F(ImageWatchTest, FineBandsCountAsBands) {
  report_.frame.fine_ripple = 3.9;
  for (int i = 0; i < 12; ++i) look();
  EXPECT_FALSE(has(Health::light_banded));
  report_.frame.fine_ripple = 4.1;
  for (int i = 0; i < 6; ++i) look();
  EXPECT_TRUE(has(Health::light_banded));
}

TEST_F(ImageWatchTest, StatisticsHaveTheirLimits) {
  report_.frame.saturated = 103;
  report_.mean_grey = 19;
  report_.frame.rough_noise = 2.6;
  report_.frame.unchanged_rows = 2;
  look();
  EXPECT_TRUE(has(Health::image_saturated));
  EXPECT_TRUE(has(Health::image_dark));
  EXPECT_TRUE(has(Health::image_noisy));
  EXPECT_TRUE(has(Health::image_repeated));
  report_.frame.saturated = 102;
  report_.mean_grey = 20;
  report_.frame.rough_noise = 2.5;
  report_.frame.unchanged_rows = 1;
  look();
  EXPECT_TRUE(watch_.health_flags().empty());
}

}  // namespace
}  // namespace dtact::pipeline
