// Points that CloudMaker keeps and points of each instruction set, compared with points made anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "clients/geometry/point_cloud.hpp"
#include "clients/geometry/rows.hpp"

namespace dtact::perceive {
namespace {

using Kind = recon::Surface::Kind;

std::vector<recon::Surface> surfaces() {
  return {{},
          {Kind::sphere, 4, 0, 20, 8, 1.41},  // rays at the map's corners miss this sphere
          {Kind::cylinder, 12, 30, 20, 8, 1.41}};
}

constexpr int kWidth = 150;  // four tiles and a part of one
constexpr int kHeight = 110;

/// 0 except for a ball that is `frame` · 7 pixels further right, some noise in it, and holes and
/// single pixels that come and go.
std::vector<std::int16_t> map_of(int frame) {
  std::mt19937 random(static_cast<unsigned>(frame));
  std::vector<std::int16_t> map(std::size_t{kWidth} * kHeight, 0);
  const auto at = [&](int row, int column) -> std::int16_t& {
    return map[static_cast<std::size_t>(row * kWidth + column)];
  };
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const double off = std::hypot(row - 50, column - 20 - 7 * frame);
      if (off < 18)
        at(row, column) =
            static_cast<std::int16_t>(900 - 3 * off * off + static_cast<double>(random() % 7));
    }
  }
  for (int i = 0; i < 12; ++i)
    at(static_cast<int>(random() % kHeight), static_cast<int>(random() % kWidth)) = -32768;
  if (frame % 2 == 1) {
    for (int row = 70; row < 95; ++row) {
      for (int column = 30; column < 80; ++column) at(row, column) = -32768;
    }
    at(82, 50) = 0;  // alone among the holes, of depth 0
  }
  return map;
}

DepthGrid grid_of(const std::vector<std::int16_t>& map) {
  return {.width = kWidth,
          .height = kHeight,
          .full_width = kWidth,
          .full_height = kHeight,
          .mm_per_px = 0.05,
          .values = map};
}

/// Compares bits; all NaNs count as equal.
void expect_same(const PointCloud& actual, const PointCloud& expected, const char* what) {
  ASSERT_EQ(actual.values.size(), expected.values.size()) << what;
  for (std::size_t i = 0; i < actual.values.size(); ++i) {
    const float a = actual.values[i];
    const float b = expected.values[i];
    if (std::isnan(a) && std::isnan(b)) continue;
    ASSERT_EQ(std::bit_cast<std::uint32_t>(a), std::bit_cast<std::uint32_t>(b))
        << what << ", value " << i << ": " << a << " for " << b;
  }
}

TEST(CloudMaker, WhatItLeavesIsWhatItWouldMake) {
  for (const recon::Surface& surface : surfaces()) {
    CloudMaker maker(surface);
    CloudMaker other_maker(surface);  // writes to a new cloud each time
    PointCloud cloud;
    PointCloud coarse;
    for (int frame = 0; frame < 12; ++frame) {
      const auto map = map_of(frame);
      maker.make(grid_of(map), 1, cloud);
      PointCloud whole;
      other_maker.make(grid_of(map), 1, whole);
      expect_same(cloud, whole, "whole");
      maker.make(grid_of(map), 3, coarse);
      for (int i = 0; i < coarse.height; ++i) {
        for (int k = 0; k < coarse.width; ++k) {
          const std::size_t from =
              static_cast<std::size_t>((coarse.y + 3 * i) * kWidth + coarse.x + 3 * k);
          const std::size_t to = static_cast<std::size_t>(i * coarse.width + k);
          ASSERT_EQ(coarse.has(to), whole.has(from));
          if (!coarse.has(to)) continue;
          ASSERT_EQ(coarse.part(PointCloud::kZ)[to], whole.part(PointCloud::kZ)[from]);
          ASSERT_EQ(coarse.part(PointCloud::kNormalX)[to], whole.part(PointCloud::kNormalX)[from]);
        }
      }
      // Another unit in between, and another part of the map in the same cloud.
      DepthGrid other = grid_of(map);
      if (frame % 5 == 2) other.um_per_unit = 2;
      if (frame % 5 == 3) {
        other.x = 20;
        other.full_width = kWidth + 40;
      }
      maker.make(other, 1, cloud);
      PointCloud anew;
      other_maker.make(other, 1, anew);
      expect_same(cloud, anew, "other");
    }
  }
}

// A sensor may change its resolution from one frame to the next; a table for a curved surface costs
// as much as hundreds of frames.
TEST(CloudMaker, KeepsTheTablesOfThreeSizes) {
  CloudMaker maker(surfaces()[2]);
  const std::vector<std::int16_t> values(std::size_t{40} * 40, 100);
  const auto table_of = [&](double mm_per_px) {
    const DepthGrid grid{.width = 40,
                         .height = 40,
                         .full_width = 40,
                         .full_height = 40,
                         .mm_per_px = mm_per_px,
                         .values = values};
    PointCloud cloud;
    maker.make(grid, 1, cloud);
    EXPECT_EQ(maker.table()->mm_per_px, mm_per_px);
    return cloud.drawn.tables;
  };
  const std::uint64_t full = table_of(0.04);
  const std::uint64_t half = table_of(0.08);
  const std::uint64_t quarter = table_of(0.16);
  EXPECT_EQ(table_of(0.04), full);
  EXPECT_EQ(table_of(0.16), quarter);
  EXPECT_NE(table_of(0.1), half) << "a fourth";
  EXPECT_EQ(table_of(0.04), full);
  EXPECT_NE(table_of(0.08), half) << "the one that was seen longest ago made way";
}

TEST(CloudMaker, LeavesACloudOfAnotherMakerAlone) {
  const auto map = map_of(0);
  PointCloud cloud;
  CloudMaker(surfaces()[1]).make(grid_of(map), 1, cloud);
  CloudMaker flat;
  PointCloud expected;
  flat.make(grid_of(map), 1, expected);
  flat.make(grid_of(map), 1, cloud);
  expect_same(cloud, expected, "after a sphere's");
}

TEST(CloudMaker, WhereZeroIsNoDepthNothingIsContactFree) {
  const auto map = map_of(0);
  DepthGrid grid = grid_of(map);
  CloudMaker maker;
  PointCloud cloud;
  maker.make(grid, 1, cloud);
  EXPECT_TRUE(cloud.has(0));
  grid.untrusted = 0;
  maker.make(grid, 1, cloud);
  EXPECT_FALSE(cloud.has(0));
}

// Halves go to the even neighbour.
TEST(Rows, QuantiseRoundsBoundsAndKeepsHoles) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> values{0.5F, 1.5F, -1.5F, -0.75F, nan, 1e9F, -1e9F, 32766.4F, 3, nan};
  std::vector<std::int16_t> units(values.size());
  quantise(values.data(), values.size(), 1, units.data());
  EXPECT_EQ(units,
            (std::vector<std::int16_t>{0, 2, -2, -1, -32768, 32767, -32767, 32766, 3, -32768}));
}

TEST(Rows, LargestIsTheFarthestFromZero) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(largest(std::vector<float>{1, -7.25F, nan, 3, -nan}.data(), 5), 7.25F);
  EXPECT_EQ(largest(&nan, 1), 0);
  EXPECT_EQ(count_holes(std::vector<float>{1, nan, 2, nan, -nan}.data(), 5), 3);
}

// Maps of one scale that differ in one side only.
TEST(CloudMaker, ATableIsOfOneWidthAndOneHeight) {
  CloudMaker maker(surfaces()[2]);
  const std::vector<std::int16_t> values(std::size_t{50} * 30, 100);
  const auto table_of = [&](int width, int height) {
    const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    const DepthGrid grid{.width = width,
                         .height = height,
                         .full_width = width,
                         .full_height = height,
                         .mm_per_px = 0.0417,
                         .values = std::span(values).first(size)};
    PointCloud cloud;
    maker.make(grid, 1, cloud);
    EXPECT_EQ(maker.table()->width, width);
    EXPECT_EQ(maker.table()->height, height);
    return cloud.drawn.tables;
  };
  const std::uint64_t first = table_of(40, 30);
  const std::uint64_t wide = table_of(50, 30);
  const std::uint64_t low = table_of(40, 20);
  EXPECT_EQ(table_of(40, 30), first);
  EXPECT_EQ(table_of(50, 30), wide);
  EXPECT_EQ(table_of(40, 20), low);
}

// A row has at most 64 tiles: those of 2049 columns are twice as wide.
TEST(CloudMaker, MakesTheLastOf64TilesAnew) {
  for (const int width : {2048, 2049}) {
    std::vector<std::int16_t> map(3 * static_cast<std::size_t>(width));
    const DepthGrid grid{.width = width,
                         .height = 3,
                         .full_width = width,
                         .full_height = 3,
                         .mm_per_px = 0.05,
                         .values = map};
    const std::size_t left = static_cast<std::size_t>(width) + 5;
    const std::size_t right = 2 * static_cast<std::size_t>(width) - 4;
    CloudMaker maker;
    PointCloud cloud;
    for (const auto& [left_um, right_um] : {std::pair{300, 500}, {0, 700}, {400, 0}, {0, 0}}) {
      map[left] = static_cast<std::int16_t>(left_um);
      map[right] = static_cast<std::int16_t>(right_um);
      maker.make(grid, 1, cloud);
      EXPECT_NEAR(cloud.part(PointCloud::kZ)[left], -1e-6 * left_um, 1e-9) << width;
      EXPECT_NEAR(cloud.part(PointCloud::kZ)[right], -1e-6 * right_um, 1e-9) << width;
      PointCloud anew;
      CloudMaker().make(grid, 1, anew);
      expect_same(cloud, anew, "the whole row");
    }
  }
}

}  // namespace
}  // namespace dtact::perceive
