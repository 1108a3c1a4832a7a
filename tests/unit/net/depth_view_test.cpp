#include "daemon/net/depth_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include "daemon/recon/model.hpp"

// clang-tidy does not recognise ASSERT_TRUE as a check.
// NOLINTBEGIN(bugprone-unchecked-optional-access)
namespace dtact::net {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;

constexpr std::int16_t kNo = recon::kUntrusted;

pipeline::DepthFrame frame_of(int width, int height, std::vector<std::int16_t> depth_um) {
  pipeline::DepthFrame frame;
  frame.has_depth = true;
  frame.width = width;
  frame.height = height;
  frame.mm_per_px = 0.5;
  frame.depth_um = std::move(depth_um);
  return frame;
}

pipeline::DepthFrame counting(int width, int height) {
  std::vector<std::int16_t> depth(static_cast<std::size_t>(width * height));
  std::iota(depth.begin(), depth.end(), std::int16_t{0});
  return frame_of(width, height, std::move(depth));
}

std::vector<std::int16_t> values_of(const pipeline::DepthFrame& frame, const DepthSpec& spec) {
  DepthViewer viewer;
  const auto view = viewer.view(frame, spec);
  return view ? std::vector<std::int16_t>(view->values.begin(), view->values.end())
              : std::vector<std::int16_t>{};
}

TEST(DepthView, IsTheFrameItselfWhenNothingElseIsAsked) {
  const auto frame = counting(4, 3);
  DepthViewer viewer;
  const auto view = viewer.view(frame, {});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->values.data(), frame.depth_um.data());
  EXPECT_EQ(view->values.size(), 12U);
  EXPECT_EQ(view->x, 0);
  EXPECT_EQ(view->y, 0);
  EXPECT_EQ(view->width, 4);
  EXPECT_EQ(view->height, 3);
  EXPECT_EQ(view->full_width, 4);
  EXPECT_EQ(view->full_height, 3);
  EXPECT_EQ(view->decimation, 1);
  EXPECT_EQ(view->um_per_unit, 1);
  EXPECT_EQ(view->mm_per_px, 0.5);
}

TEST(DepthView, WholeRowsAreNotCopied) {
  const auto frame = counting(4, 3);
  DepthViewer viewer;
  const auto view = viewer.view(frame, {.region = DepthRegion{0, 1, 9, 9}});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->values.data(), frame.depth_um.data() + 4);
  EXPECT_EQ(view->height, 2);
}

TEST(DepthView, RoundsUnitsHalfAwayFromZero) {
  const auto frame = frame_of(10, 1, {0, 1, -1, 2, -2, 3, -3, kNo, 32767, -32767});
  EXPECT_THAT(values_of(frame, {.um_per_unit = 2}),
              ElementsAre(0, 1, -1, 1, -1, 2, -2, kNo, 16384, -16384));
  EXPECT_THAT(values_of(frame, {.um_per_unit = 5}),
              ElementsAre(0, 0, 0, 0, 0, 1, -1, kNo, 6553, -6553));
  EXPECT_THAT(values_of(frame, {.um_per_unit = 10}),
              ElementsAre(0, 0, 0, 0, 0, 0, 0, kNo, 3277, -3277));
  EXPECT_THAT(values_of(frame_of(4, 1, {15, -15, 14, 25}), {.um_per_unit = 10}),
              ElementsAre(2, -2, 1, 3));
}

TEST(DepthView, AveragesWhatIsTrusted) {
  // Blocks of 2 × 2: all trusted (mean 2.5), three trusted (4/3), two (half: untrusted), none.
  const auto frame = frame_of(8, 2,
                              {1, 2, 0, 1, 7, 7, kNo, kNo,  //
                               3, 4, 3, kNo, kNo, kNo, kNo, kNo});
  DepthViewer viewer;
  const auto view = viewer.view(frame, {.decimation = 2});
  ASSERT_TRUE(view);
  EXPECT_THAT(view->values, ElementsAre(3, 1, kNo, kNo));
  EXPECT_EQ(view->width, 4);
  EXPECT_EQ(view->height, 1);
  EXPECT_EQ(view->full_width, 4);
  EXPECT_EQ(view->decimation, 2);
  EXPECT_EQ(view->mm_per_px, 1.0);
}

TEST(DepthView, RoundsOnceAndNotTwice) {
  // The mean 4.75 is less than half a unit of 10 um; rounded to 5 first it would become one.
  EXPECT_THAT(values_of(frame_of(2, 2, {4, 5, 5, 5}), {.decimation = 2, .um_per_unit = 10}),
              ElementsAre(0));
  EXPECT_THAT(values_of(frame_of(2, 2, {-5, -5, -5, -5}), {.decimation = 2, .um_per_unit = 10}),
              ElementsAre(-1));
}

TEST(DepthView, ExtremesStayApartFromUntrusted) {
  const std::vector<std::int16_t> least(16, -32767);
  EXPECT_THAT(values_of(frame_of(4, 4, least), {.decimation = 4}), ElementsAre(-32767));
  const std::vector<std::int16_t> most(16, 32767);
  EXPECT_THAT(values_of(frame_of(4, 4, most), {.decimation = 4}), ElementsAre(32767));
}

TEST(DepthView, LeavesOutWhatFillsNoBlockOnBothSides) {
  // Six columns at 4: the middle four. Five rows at 4: the upper four.
  const auto frame = counting(6, 5);
  DepthViewer viewer;
  const auto view = viewer.view(frame, {.decimation = 4});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->full_width, 1);
  EXPECT_EQ(view->full_height, 1);
  // Columns 1 … 4 (mean 2.5), rows 0 … 3 (mean 1.5 × 6 = 9).
  EXPECT_THAT(view->values, ElementsAre(12));
}

TEST(DepthView, CutsARegion) {
  DepthViewer viewer;
  const auto frame = counting(4, 3);
  const auto view = viewer.view(frame, {.region = DepthRegion{1, 1, 2, 2}});
  ASSERT_TRUE(view);
  EXPECT_THAT(view->values, ElementsAre(5, 6, 9, 10));
  EXPECT_EQ(view->x, 1);
  EXPECT_EQ(view->y, 1);
  EXPECT_EQ(view->width, 2);
  EXPECT_EQ(view->height, 2);
  EXPECT_EQ(view->full_width, 4);
  EXPECT_EQ(view->full_height, 3);
}

TEST(DepthView, CutsARegionAtTheBorder) {
  EXPECT_THAT(values_of(counting(4, 3), {.region = DepthRegion{3, 2, UINT32_MAX, UINT32_MAX}}),
              ElementsAre(11));
}

TEST(DepthView, GrowsARegionToWholeBlocks) {
  DepthViewer viewer;
  const auto frame = counting(16, 8);
  // Columns 5 … 9 reach into the blocks of 4 from 4 to 11, row 3 into the block from 0 to 3.
  const auto view = viewer.view(frame, {.decimation = 4, .region = DepthRegion{5, 3, 5, 1}});
  ASSERT_TRUE(view);
  EXPECT_EQ(view->x, 1);
  EXPECT_EQ(view->y, 0);
  EXPECT_EQ(view->width, 2);
  EXPECT_EQ(view->height, 1);
  EXPECT_EQ(view->full_width, 4);
  EXPECT_EQ(view->full_height, 2);
  // Means of columns 4 … 7 (5.5) and 8 … 11 (9.5), rows 0 … 3 (1.5 × 16 = 24): 29.5 and 33.5.
  EXPECT_THAT(view->values, ElementsAre(30, 34));
}

TEST(DepthView, ARegionBesideTheMapIsNothing) {
  DepthViewer viewer;
  const auto frame = counting(4, 3);
  EXPECT_FALSE(viewer.view(frame, {.region = DepthRegion{4, 0, 1, 1}}));
  EXPECT_FALSE(viewer.view(frame, {.region = DepthRegion{0, 3, 1, 1}}));
  EXPECT_FALSE(viewer.view(frame, {.region = DepthRegion{UINT32_MAX, 0, UINT32_MAX, 1}}));
}

TEST(DepthView, AMapBelowOneBlockIsNothing) {
  DepthViewer viewer;
  EXPECT_FALSE(viewer.view(counting(4, 3), {.decimation = 4}));
}

TEST(DepthView, ACoarseFrameIsSentAsItIs) {
  auto frame = counting(4, 3);
  frame.decimation = 4;
  DepthViewer viewer;
  // Columns 5 … 9 at full resolution are columns 1 and 2 of the frame; row 8 is its row 2.
  const auto view = viewer.view(frame, {.decimation = 1, .region = DepthRegion{5, 8, 5, 1}});
  ASSERT_TRUE(view);
  EXPECT_THAT(view->values, ElementsAre(9, 10));
  EXPECT_EQ(view->decimation, 4);
  EXPECT_EQ(view->mm_per_px, 0.5);
  EXPECT_EQ(view->full_width, 4);
}

TEST(DepthView, AFrameAtHalfIsHalvedOnceMore) {
  auto frame = counting(4, 2);
  frame.decimation = 2;
  DepthViewer viewer;
  const auto view = viewer.view(frame, {.decimation = 4});
  ASSERT_TRUE(view);
  EXPECT_THAT(view->values, ElementsAre(3, 5));  // 2.5 and 4.5
  EXPECT_EQ(view->decimation, 4);
  EXPECT_EQ(view->mm_per_px, 1.0);
}

TEST(DepthView, UsesItsBufferAgain) {
  DepthViewer viewer;
  const auto frame = counting(16, 8);
  const auto* first = viewer.view(frame, {.um_per_unit = 5})->values.data();
  (void)viewer.view(frame, {.decimation = 2});
  EXPECT_EQ(viewer.view(frame, {.um_per_unit = 5})->values.data(), first);
}

TEST(DepthView, RefusesOtherSpecs) {
  DepthViewer viewer;
  const auto frame = counting(4, 4);
  EXPECT_THROW((void)viewer.view(frame, {.decimation = 0}), std::invalid_argument);
  EXPECT_THROW((void)viewer.view(frame, {.decimation = 3}), std::invalid_argument);
  EXPECT_THROW((void)viewer.view(frame, {.um_per_unit = 0}), std::invalid_argument);
  EXPECT_THROW((void)viewer.view(frame, {.um_per_unit = 4}), std::invalid_argument);
}

/// The definition, computed pixel by pixel in double precision.
std::vector<std::int16_t> naive(const pipeline::DepthFrame& frame, int factor, int um,
                                const DepthView& view) {
  const int left = frame.width % factor / 2;
  const int top = frame.height % factor / 2;
  std::vector<std::int16_t> out;
  for (int y = view.y; y < view.y + view.height; ++y) {
    for (int x = view.x; x < view.x + view.width; ++x) {
      double sum = 0;
      int count = 0;
      for (int i = 0; i < factor * factor; ++i) {
        const int row = y * factor + top + i / factor;
        const int column = x * factor + left + i % factor;
        const std::int16_t value =
            frame.depth_um[static_cast<std::size_t>(row * frame.width + column)];
        if (value == kNo) continue;
        sum += value;
        ++count;
      }
      const bool trusted = factor * factor - count < (factor * factor + 1) / 2;
      out.push_back(trusted ? static_cast<std::int16_t>(std::round(sum / (count * um))) : kNo);
    }
  }
  return out;
}

TEST(DepthView, IsTheDefinitionOnArbitraryMaps) {
  std::mt19937 random(20);
  const auto below = [&](int limit) { return static_cast<int>(random() % unsigned(limit)); };
  DepthViewer viewer;
  for (int round = 0; round < 300; ++round) {
    auto frame = frame_of(1 + below(70), 1 + below(30), {});
    const int reach = round % 3 == 0 ? 65535 : 60;
    const int untrusted = below(4);  // tenths of the pixels
    for (int i = 0; i < frame.width * frame.height; ++i) {
      frame.depth_um.push_back(
          below(10) < untrusted ? kNo : static_cast<std::int16_t>(below(reach) - reach / 2));
    }
    for (const int factor : {1, 2, 4}) {
      for (const int um : {1, 2, 5, 10}) {
        DepthSpec spec{.decimation = factor, .um_per_unit = um};
        if (below(2) == 0) {
          spec.region = DepthRegion{unsigned(below(frame.width)), unsigned(below(frame.height)),
                                    1 + unsigned(below(70)), 1 + unsigned(below(30))};
        }
        const auto view = viewer.view(frame, spec);
        if (!view) continue;
        ASSERT_THAT(view->values, ElementsAreArray(naive(frame, factor, um, *view)))
            << frame.width << " x " << frame.height << " at " << factor << ", " << um << " um";
      }
    }
  }
}

}  // namespace
}  // namespace dtact::net
// NOLINTEND(bugprone-unchecked-optional-access)
