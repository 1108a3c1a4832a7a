// Sums over a map: the scalar kernels against literal values, every instruction set against
// them, and whole reconstructions against a plain pass over the finished map.
#include "daemon/recon/depth_sums.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <tuple>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/vector_kernels.hpp"
#include "tests/unit/recon/every_target.hpp"

namespace dtact::recon {
namespace {

constexpr SumRules kRules{
    .threshold_um = 100, .release_um = 50, .bend_reach = 0, .bend_from_um = 80};

auto all_of(const DepthSums& s) {
  return std::tuple(s.made, s.um, s.um_x, s.um_y, s.square, s.square_x, s.square_y, s.lost,
                    s.deepest_um, s.deepest_x, s.deepest_y, s.bent, s.bend_um);
}

TEST(SumRow, CountsAboveTheThresholdsOnly) {
  const std::vector<std::int16_t> row{50, 51, 100, 101, 300, kUntrusted, -400};
  DepthSums sums(kRules);
  kernels::sum_row(row.data(), 10, 0, 7, sums);
  EXPECT_EQ(sums.lost, 4);
  EXPECT_EQ(sums.made, 2);
  EXPECT_EQ(sums.um, 401);
  EXPECT_EQ(sums.um_x, 3 * 101 + 4 * 300);
  EXPECT_EQ(sums.um_y, 4010);
  EXPECT_EQ(sums.square, 1 + 11);  // 10201 and 90000 over 8192
  EXPECT_EQ(sums.square_x, 3 * 1 + 4 * 11);
  EXPECT_EQ(sums.square_y, 120);
  EXPECT_EQ(sums.deepest_um, 300);
  EXPECT_EQ(sums.deepest_x, 4);
  EXPECT_EQ(sums.deepest_y, 10);
}

TEST(SumRow, TheFirstOfTheDeepestStandsInWhateverOrderRowsCome) {
  const std::vector<std::int16_t> row{0, 7, 0, 7, 0};
  DepthSums sums(kRules);
  kernels::sum_row(row.data(), 6, 0, 5, sums);
  kernels::sum_row(row.data(), 5, 2, 5, sums);
  EXPECT_EQ(std::tuple(sums.deepest_x, sums.deepest_y), std::tuple(3, 5));
  kernels::sum_row(row.data(), 5, 0, 2, sums);
  EXPECT_EQ(std::tuple(sums.deepest_x, sums.deepest_y), std::tuple(1, 5));
  kernels::sum_row(row.data(), 7, 0, 5, sums);
  EXPECT_EQ(std::tuple(sums.deepest_x, sums.deepest_y), std::tuple(1, 5));
}

TEST(SumRow, UntrustedPixelsAreNoDeepest) {
  const std::vector<std::int16_t> row{kUntrusted, kUntrusted};
  DepthSums sums(kRules);
  kernels::sum_row(row.data(), 0, 0, 2, sums);
  EXPECT_EQ(sums.deepest_um, kUntrusted);
  const std::vector<std::int16_t> raised{kUntrusted, -30};
  kernels::sum_row(raised.data(), 3, 0, 2, sums);
  EXPECT_EQ(std::tuple(sums.deepest_um, sums.deepest_x, sums.deepest_y), std::tuple(-30, 1, 3));
}

TEST(BendRow, IsTheSecondDifferenceOfPressedAndTrustedPixels) {
  // clang-format off
  std::vector<std::int16_t> map{0,  90, 200, 90,  0,
                                80, 81, 300, 500, 0,
                                0,  70, 150, 60,  0};
  // clang-format on
  DepthSums sums({.bend_reach = 1, .bend_from_um = 80});
  kernels::bend_row(map.data() + 5, 5, 1, 4, sums);
  EXPECT_EQ(sums.bent, 3);
  // 81: |80 + 300 + 90 + 70 − 324|, 300: |81 + 500 + 200 + 150 − 1200|, 500: |300 + 0 + 90 + 60 −
  // 2000|.
  EXPECT_EQ(sums.bend_um, 216 + 269 + 1550);
  map[2] = kUntrusted;
  DepthSums fewer({.bend_reach = 1, .bend_from_um = 81});
  kernels::bend_row(map.data() + 5, 5, 1, 4, fewer);
  EXPECT_EQ(std::tuple(fewer.bent, fewer.bend_um), std::tuple(1, 1550));
}

// Far beyond any gel: pixels of 16 mm beside pixels of −16 mm.
TEST(BendRow, NoPixelAddsMoreThan32Millimetres) {
  std::vector<std::int16_t> map(9, -16383);
  map[4] = 16383;
  DepthSums sums({.bend_reach = 1, .bend_from_um = 80});
  kernels::bend_row(map.data() + 3, 3, 1, 2, sums);
  EXPECT_EQ(std::tuple(sums.bent, sums.bend_um), std::tuple(1, 32767));
}

// A caller that names no threshold sums, counts and bends at every pixel deeper than nothing.
TEST(SumRules, AreZeroWhereNothingIsStated) {
  const std::vector<std::int16_t> map{0, 0, 0,  //
                                      0, 1, 0,  //
                                      0, 0, 0};
  DepthSums sums({.bend_reach = 1});
  kernels::sum_row(map.data() + 3, 1, 0, 3, sums);
  kernels::bend_row(map.data() + 3, 3, 1, 2, sums);
  EXPECT_EQ(std::tuple(sums.made, sums.lost, sums.um), std::tuple(1, 1, 1));
  EXPECT_EQ(std::tuple(sums.um_x, sums.um_y), std::tuple(1, 1));
  EXPECT_EQ(std::tuple(sums.bent, sums.bend_um), std::tuple(1, 4));
  EXPECT_EQ(SumRules{}.bend_reach, 0) << "no bend unless it is asked for";
}

class VectorSums : public EveryTarget {
 protected:
  int uniform(int low, int high) {
    return low + static_cast<int>(random_() % (static_cast<unsigned>(high - low) + 1));
  }
  /// Flat and steep places, ties, holes and both ends of the range of depth.
  std::vector<std::int16_t> map_of(int pixels) {
    std::vector<std::int16_t> map;
    const int kind = uniform(0, 3);
    for (int i = 0; i < pixels; ++i) {
      const int dice = uniform(0, 40);
      const int um = kind == 0   ? 0
                     : kind == 1 ? uniform(-20, 60)
                     : kind == 2 ? 100 * uniform(-1, 3)
                                 : uniform(-16383, 16383);
      map.push_back(static_cast<std::int16_t>(dice == 0   ? int{kUntrusted}
                                              : dice == 1 ? 16383
                                              : dice == 2 ? -16383
                                                          : um));
    }
    return map;
  }

 private:
  std::minstd_rand random_{3};
};

TEST_P(VectorSums, EveryPlaceAndWidth) {
  for (int width = 1; width < 1200; width += width < 140 ? 1 : uniform(1, 90)) {
    constexpr int kHeight = 3;
    const int stride = width + uniform(0, 3);
    const std::vector<std::int16_t> map = map_of(stride * kHeight);
    const int x0 = uniform(0, width - 1);
    for (const auto& [from, to] : {std::tuple(0, width), std::tuple(x0, width)}) {
      DepthSums is(kRules);
      DepthSums should(kRules);
      vec::sum_rows(map.data(), stride, from, to, 1, kHeight, is);
      for (int y = 1; y < kHeight; ++y) {
        kernels::sum_row(map.data() + std::ptrdiff_t{y} * stride, y, from, to, should);
      }
      ASSERT_EQ(all_of(is), all_of(should)) << from << " to " << to;
      vec::sum_rows(map.data(), stride, from, to, 0, 1, is);  // added to the previous sums
      kernels::sum_row(map.data(), 0, from, to, should);
      ASSERT_EQ(all_of(is), all_of(should)) << from << " to " << to;
    }
  }
}

TEST_P(VectorSums, TheDeepestMapOfAll) {
  const std::vector<std::int16_t> map(std::size_t{2048} * 2, 16383);
  DepthSums sums(kRules);
  vec::sum_rows(map.data(), 2048, 0, 2048, 0, 2, sums);
  EXPECT_EQ(sums.um, 16383LL * 4096);
  EXPECT_EQ(sums.um_x, 16383LL * 2 * 2047 * 1024);
  EXPECT_EQ(sums.um_y, 16383LL * 2048);
  EXPECT_EQ(sums.square, 32764LL * 2048);
  EXPECT_EQ(sums.square_x, 32764LL * 2047 * 1024);
}

TEST_P(VectorSums, BendsAtEveryReachAndWidth) {
  for (int width = 3; width < 300; width += uniform(1, 5)) {
    const int reach = uniform(1, std::min(9, (width - 1) / 2));
    const int height = 2 * reach + 1;
    const std::vector<std::int16_t> map = map_of(width * height);
    const SumRules rules{.bend_reach = reach,
                         .bend_from_um = static_cast<std::int16_t>(uniform(-100, 100))};
    DepthSums is(rules);
    DepthSums should(rules);
    const std::int16_t* row = map.data() + std::ptrdiff_t{reach} * width;
    vec::bend_row(row, width, reach, width - reach, is);
    kernels::bend_row(row, width, reach, width - reach, should);
    ASSERT_EQ(all_of(is), all_of(should)) << width << ", reach " << reach;
  }
}

/// The tiles' pixels of a finished map, one after the other.
DepthSums walk(const std::vector<std::int16_t>& map, const TileGrid& grid, const TileRows& tiles,
               const SumRules& rules) {
  DepthSums sums(rules);
  const int reach = rules.bend_reach;
  const int step = std::min(reach, 4);
  const auto at = [&](int x, int y) { return map[static_cast<std::size_t>(y * grid.width + x)]; };
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const std::uint64_t row = tiles[static_cast<std::size_t>(y / TileGrid::kRows)];
      if ((row >> (x / grid.tile_width()) & 1U) == 0 || at(x, y) == kUntrusted) continue;
      const int um = at(x, y);
      sums.lost += um > rules.release_um ? 1 : 0;
      if (um > rules.threshold_um) {
        sums.made += 1;
        sums.um += um;
        sums.um_x += um * x;
        sums.um_y += um * y;
        const std::int64_t square = y % 2 == 0 ? std::lround(um * um / DepthSums::kSquareUm2) : 0;
        sums.square += square;
        sums.square_x += square * x;
        sums.square_y += square * y;
      }
      if (um > sums.deepest_um) {
        sums.deepest_um = static_cast<std::int16_t>(um);
        sums.deepest_x = x;
        sums.deepest_y = y;
      }
      if (reach == 0 || um <= rules.bend_from_um || y < reach || y >= grid.height - reach ||
          x < reach || x >= grid.width - reach || (y - reach) % step != 0) {
        continue;
      }
      const std::vector<int> around{at(x - reach, y), at(x + reach, y), at(x, y - reach),
                                    at(x, y + reach)};
      if (std::ranges::count(around, kUntrusted) > 0) continue;
      const auto int16 = [](int value) { return std::clamp(value, -32768, 32767); };
      const int across = int16(around[0] + around[1] - 2 * um);
      const int along = int16(around[2] + around[3] - 2 * um);
      sums.bent += 1;
      sums.bend_um += std::min(std::abs(int16(across + along)), 32767);
    }
  }
  return sums;
}

TEST_P(VectorSums, StripsGiveWhatAWalkOverTheMapGives) {
  for (int round = 0; round < 60; ++round) {
    const TileGrid grid(uniform(1, 300), uniform(1, 120));
    const std::vector<std::int16_t> map = map_of(grid.width * grid.height);
    TileRows tiles;
    for (int row = 0; row < grid.rows(); ++row) {
      tiles.push_back(static_cast<std::uint64_t>(uniform(0, INT32_MAX)) & grid.all());
    }
    SumRules rules = kRules;
    rules.bend_reach = uniform(0, 20);
    DepthSums sums(rules);
    StripSums strips(grid, tiles, map.data(), sums);
    for (int row = 0; row < grid.rows(); ++row) strips.finished(row);
    ASSERT_EQ(all_of(sums), all_of(walk(map, grid, tiles, rules)))
        << grid.width << "x" << grid.height << ", reach " << rules.bend_reach;
  }
}

/// A frame read one to one; a LUT of half a micrometre a sixty-fourth.
Model model_of(Method method, int width, int height) {
  Model model;
  model.method = method;
  model.rectify = {width + 1, height + 1, width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      model.rectify.entries.push_back(
          {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y), 0, 0});
    }
  }
  model.mm_per_px = 0.05;
  model.smoothing_px = 1;
  model.lut = {-40 * 64, {}, -40 * 64, 90 * 64};
  for (int q6 = -40 * 64; q6 <= 90 * 64; ++q6) {
    model.lut.um.push_back(static_cast<std::int16_t>(q6 / 2));
  }
  model.reference_q8.assign(static_cast<std::size_t>((width + 1) * (height + 1)), 150 << 8);
  model.untrusted.resize(model.rectify.entries.size());
  return model;
}

TEST_P(VectorSums, AReconstructionAddsUpItsOwnMap) {
  for (const Method method : {Method::lut, Method::published}) {
    constexpr int kWidth = 200;
    constexpr int kHeight = 130;
    Model model = model_of(method, kWidth, kHeight);
    for (int i = 0; i < 300; ++i) {
      model.untrusted[static_cast<std::size_t>(uniform(0, kWidth * kHeight - 1))] = 1;
    }
    Reconstructor reconstructor(std::make_shared<Model>(model));
    std::vector<std::int16_t> depth(std::size_t{kWidth} * kHeight);
    DrawnTiles drawn;
    for (int round = 0; round < 4; ++round) {
      std::vector<std::uint8_t> luma(
          static_cast<std::size_t>((kWidth + 1) * (kHeight + 1)) + kLumaPadding, 150);
      const int x0 = uniform(0, 120);
      const int y0 = uniform(0, 90);
      for (int y = y0; y < y0 + 30; ++y) {
        for (int x = x0; x < x0 + 50; ++x) {
          luma[static_cast<std::size_t>(y * (kWidth + 1) + x)] =
              static_cast<std::uint8_t>(uniform(90, 130));
        }
      }
      SumRules rules = kRules;
      rules.bend_reach = round;
      DepthSums sums(rules);
      // The press, and the rows of tiles above and below it.
      TileRows tiles(static_cast<std::size_t>(reconstructor.grid().rows()));
      for (int row = std::max(0, y0 / TileGrid::kRows - 1);
           row <= std::min<int>((y0 + 30) / TileGrid::kRows + 1, reconstructor.grid().rows() - 1);
           ++row) {
        tiles[static_cast<std::size_t>(row)] = reconstructor.grid().all();
      }
      reconstructor.run_active(luma.data(), kWidth + 1, tiles, depth, drawn, nullptr, &sums);
      const DepthSums should = walk(depth, reconstructor.grid(), drawn.tiles, rules);
      ASSERT_GT(should.made, 500);
      ASSERT_EQ(should.bent > 0, round > 0);
      ASSERT_EQ(all_of(sums), all_of(should)) << round;
    }
  }
}

DTACT_EVERY_TARGET(VectorSums);

}  // namespace
}  // namespace dtact::recon
