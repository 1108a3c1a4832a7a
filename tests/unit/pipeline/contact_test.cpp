#include "daemon/pipeline/depth/contact.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

// 11×11 pixels of 0.5 mm: a pixel is 0.25 mm², the centre is pixel (5, 5).
constexpr int kSide = 11;
constexpr std::size_t kPixels = std::size_t{kSide} * kSide;
constexpr double kMmPerPx = 0.5;

class ContactTest : public ::testing::Test {
 protected:
  /// Sets `count` pixels from the map's start to a depth.
  void fill(std::int16_t um, int count) {
    map.assign(kPixels, 0);
    for (int i = 0; i < count; ++i) map[static_cast<std::size_t>(i)] = um;
  }
  ContactSummary summarise() {
    recon::DepthSums sums(detector.sum_rules());
    for (int y = 0; y < kSide; ++y) {
      recon::kernels::sum_row(map.data() + std::ptrdiff_t{y} * kSide, y, 0, kSide, sums);
    }
    return detector.inspect(sums, kSide, kSide, kMmPerPx, view);
  }
  bool inspect() { return summarise().in_contact; }

  ContactDetector detector{
      {.threshold_mm = 0.10, .release_mm = 0.05, .area_mm2 = 0.5, .debounce_frames = 2}};
  std::vector<std::int16_t> map = std::vector<std::int16_t>(kPixels, 0);
  recon::Viewpoint view;
};

TEST_F(ContactTest, NothingPressedIsNoContact) {
  const ContactSummary summary = summarise();
  EXPECT_FALSE(summary.in_contact);
  EXPECT_EQ(summary.area_mm2, 0);
  EXPECT_EQ(summary.volume_mm3, 0);
  EXPECT_EQ(summary.deepest_mm, 0);
}

TEST_F(ContactTest, SummaryIsInMillimetresFromTheCentre) {
  map[7 * kSide + 8] = 300;  // 3 px right, 2 px down
  map[7 * kSide + 9] = 900;  // 4 px right, 2 px down
  const ContactSummary summary = summarise();
  EXPECT_DOUBLE_EQ(summary.threshold_mm, 0.10);
  EXPECT_DOUBLE_EQ(summary.area_mm2, 0.5);
  EXPECT_DOUBLE_EQ(summary.x_mm, 1.875);  // (1.5·300 + 2.0·900) / 1200
  EXPECT_DOUBLE_EQ(summary.y_mm, 1.0);
  EXPECT_DOUBLE_EQ(summary.deepest_mm, 0.9);
  EXPECT_DOUBLE_EQ(summary.deepest_x_mm, 2.0);
  EXPECT_DOUBLE_EQ(summary.deepest_y_mm, 1.0);
  EXPECT_DOUBLE_EQ(summary.volume_mm3, 0.3);  // 1.2 mm × 0.25 mm²
}

// A paraboloid of 1 mm at (6, −4) mm, 6 mm wide where it is 0.1 mm deep, as a camera 25 mm above
// (−0.5, 0.3) sees it. Its volume above 0.1 mm is that of the paraboloid's cap and of the disc
// below.
TEST(ContactPlace, IsTrueUnderACameraThatIsNear) {
  constexpr int kWidth = 500;
  constexpr int kHeight = 400;
  constexpr double kPx = 0.0417;
  const recon::Viewpoint view{{-0.5, 0.3}, 1.0 / 25};
  const auto depth_at = [](recon::Point mm) {
    return 1 - 0.1 * (std::pow(mm.x - 6, 2) + std::pow(mm.y + 4, 2));
  };
  ContactDetector detector({.threshold_mm = 0.10});
  recon::DepthSums sums(detector.sum_rules());
  for (int y = 0; y < kHeight; ++y) {
    std::vector<std::int16_t> row;
    for (int x = 0; x < kWidth; ++x) {
      const recon::Point seen{(x - 0.5 * (kWidth - 1)) * kPx, (y - 0.5 * (kHeight - 1)) * kPx};
      double depth = depth_at(seen);
      for (int round = 0; round < 20; ++round) depth = depth_at(view.place(seen, depth));
      row.push_back(static_cast<std::int16_t>(std::lround(1000 * std::max(0.0, depth))));
    }
    recon::kernels::sum_row(row.data(), y, 0, kWidth, sums);
  }
  const ContactSummary summary = detector.inspect(sums, kWidth, kHeight, kPx, view);
  EXPECT_NEAR(summary.x_mm, 6, 0.012);
  EXPECT_NEAR(summary.y_mm, -4, 0.012);
  EXPECT_NEAR(summary.deepest_x_mm, 6, 0.06) << "to a pixel";
  EXPECT_NEAR(summary.deepest_y_mm, -4, 0.06);
  const double area = std::numbers::pi * 9;
  EXPECT_NEAR(summary.area_mm2, area, 0.005 * area);
  const double volume = 0.1 * area + 0.45 * area;
  EXPECT_NEAR(summary.volume_mm3, volume, 0.005 * volume);
  const ContactSummary unknown = detector.inspect(sums, kWidth, kHeight, kPx, {});
  EXPECT_GT(unknown.x_mm, 6.08) << "as it is seen";
}

TEST_F(ContactTest, IsMadeAfterTheDebounceOnly) {
  fill(101, 2);
  EXPECT_FALSE(inspect());
  EXPECT_TRUE(inspect());
}

TEST_F(ContactTest, AFlickerMakesNoContact) {
  fill(500, 10);
  EXPECT_FALSE(inspect());
  fill(0, 0);
  EXPECT_FALSE(inspect());
  fill(500, 10);
  EXPECT_FALSE(inspect());
}

TEST_F(ContactTest, NeedsTheAreaAndTheDepth) {
  fill(500, 1);  // 0.25 mm²
  EXPECT_FALSE(inspect());
  EXPECT_FALSE(inspect());
  fill(100, 50);  // not deeper than 0.10 mm
  EXPECT_FALSE(inspect());
  EXPECT_FALSE(inspect());
}

TEST_F(ContactTest, BetweenTheThresholdsNothingChanges) {
  fill(70, 20);
  EXPECT_FALSE(inspect());
  EXPECT_FALSE(inspect());
  fill(300, 20);
  EXPECT_FALSE(inspect());
  EXPECT_TRUE(inspect());
  fill(70, 20);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(inspect());
  fill(50, 20);  // not deeper than 0.05 mm
  EXPECT_TRUE(inspect());
  EXPECT_FALSE(inspect());
}

TEST_F(ContactTest, UntrustedPixelsCountForNothing) {
  map.assign(map.size(), recon::kUntrusted);
  const ContactSummary none = summarise();
  EXPECT_EQ(none.area_mm2, 0);
  EXPECT_EQ(none.deepest_mm, 0);
  map[5 * kSide + 5] = -20;
  EXPECT_DOUBLE_EQ(summarise().deepest_mm, -0.02);
}

TEST_F(ContactTest, AMapOfWhichNothingWasComputedIsNoContact) {
  const ContactSummary summary =
      detector.inspect(recon::DepthSums(detector.sum_rules()), 580, 580, kMmPerPx, {});
  EXPECT_FALSE(summary.in_contact);
  EXPECT_EQ(summary.deepest_mm, 0);
  EXPECT_EQ(summary.deepest_x_mm, 0);
}

TEST_F(ContactTest, AsksForItsOwnThresholdsAndForNoBend) {
  const recon::SumRules rules = detector.sum_rules();
  EXPECT_EQ(rules.threshold_um, 100);
  EXPECT_EQ(rules.release_um, 50);
  EXPECT_EQ(rules.bend_reach, 0);
}

}  // namespace
}  // namespace dtact::pipeline
