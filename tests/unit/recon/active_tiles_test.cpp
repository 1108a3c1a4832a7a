#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "daemon/recon/reconstructor.hpp"
#include "tests/unit/recon/every_target.hpp"
#include "tests/unit/recon/specification.hpp"

namespace dtact::recon {
namespace {

constexpr int kFrameWidth = 210;
constexpr int kFrameHeight = 150;

std::size_t pixel(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

Model make_model() {
  Model model;
  model.rectify =
      make_crop_table(kFrameWidth, kFrameHeight, 1, 2, kFrameWidth - 2, kFrameHeight - 5);
  model.mm_per_px = 0.05;
  model.smoothing_px = 2;
  model.lut = {-40 * 64, {}, -40 * 64, 100 * 64};
  for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
    model.lut.um.push_back(static_cast<std::int16_t>(q6 / 2));  // 32 µm a level
  }
  model.scattering = Scattering{.narrow_mm = 0.08, .wide_mm = 0.25, .narrow_weight = 0.7};
  model.sharpened = {{.steps = 1, .lut = model.lut, .uncertainty = {}},
                     {.steps = 2, .lut = model.lut, .uncertainty = {}}};
  model.reference_q8.assign(pixel(0, kFrameHeight, kFrameWidth), 150 * 256);
  return model;
}

/// Compares all of run_active with the specification, on every instruction set.
class ActiveTiles : public EveryTarget {
 protected:
  static void expect_the_full_result(int steps);
};

TEST_P(ActiveTiles, HoldTheFullResultAndTheRestIsCleared) { expect_the_full_result(0); }
TEST_P(ActiveTiles, HoldTheFullResultOfOneStep) { expect_the_full_result(1); }
TEST_P(ActiveTiles, HoldTheFullResultOfTwoSteps) { expect_the_full_result(2); }

void ActiveTiles::expect_the_full_result(int steps) {
  Model made = make_model();
  made.untrusted.assign(made.rectify.entries.size(), 0);
  made.untrusted[5] = 1;
  made.untrusted[made.untrusted.size() / 2] = 1;
  const auto model = std::make_shared<const Model>(std::move(made));
  Reconstructor reconstructor(model, steps);
  Specification specification(*model, steps);
  const TileGrid& grid = reconstructor.grid();
  // Two buffers in unequal turns, like a frame pool's.
  std::vector<std::int16_t> depth[2];
  DrawnTiles drawn[2];
  for (auto& buffer : depth) buffer.assign(model->rectify.entries.size(), 12345);

  std::mt19937 random(9);
  int partly = 0;
  for (int i = 0; i < 60; ++i) {
    const int x0 = static_cast<int>(random() % kFrameWidth);
    const int y0 = static_cast<int>(random() % kFrameHeight);
    const int radius = static_cast<int>(random() % 50) - 10;
    std::vector<std::uint8_t> luma(pixel(0, kFrameHeight, kFrameWidth) + 64, 150);
    for (int y = 0; y < kFrameHeight; ++y) {
      for (int x = 0; x < kFrameWidth; ++x) {
        if (std::hypot(x - x0, y - y0) < radius) {
          luma[pixel(x, y, kFrameWidth)] = static_cast<std::uint8_t>(20 + random() % 200);
        }
      }
    }
    if (i == 40) {
      std::vector<std::uint16_t> darker(model->reference_q8);
      darker[3000] = 0;
      reconstructor.set_reference(darker);
      specification.set_reference(darker);
    }
    const std::size_t b = random() % 3 == 0 ? 1 : 0;
    TileRows tiles(static_cast<std::size_t>(grid.rows()));
    for (std::uint64_t& row : tiles) {
      // One tile in four.
      row = random() & grid.all();
      row &= random();
    }
    if (i % 10 == 0) std::ranges::fill(tiles, i % 20 == 0 ? grid.all() : 0);
    // A few adjacent tiles: a filter then reads only part of the map.
    if (i % 3 == 0) {
      const std::uint64_t mask = (random() % 3 + 1) << (random() % 6);
      const std::size_t row = random() % tiles.size();
      for (std::size_t y = 0; y < tiles.size(); ++y) {
        tiles[y] = y == row || y == row + 1 ? mask & grid.all() : 0;
      }
    }
    reconstructor.run_active(luma.data(), kFrameWidth, tiles, depth[b], drawn[b]);
    ASSERT_EQ(drawn[b].tiles, tiles);
    if (count_tiles(tiles) > 0 && count_tiles(tiles) < 70) ++partly;

    const std::vector<std::int16_t> full = specification.run(luma.data(), kFrameWidth);
    for (int y = 0; y < grid.height; ++y) {
      for (int x = 0; x < grid.width; ++x) {
        const auto at = pixel(x, y, grid.width);
        const std::uint64_t row = drawn[b].tiles[static_cast<std::size_t>(y / TileGrid::kRows)];
        const bool active = (row >> (x / grid.tile_width()) & 1U) != 0;
        const bool marked = full[at] == kUntrusted && model->untrusted[at] != 0;
        const bool dark = i >= 40 && full[at] == kUntrusted;
        const int rest = marked || (dark && depth[b][at] == kUntrusted) ? kUntrusted : 0;
        ASSERT_EQ(depth[b][at], active ? full[at] : rest) << x << ", " << y << " in frame " << i;
      }
    }
  }
  EXPECT_GT(partly, 20);
}

TEST_P(ActiveTiles, NoTilesAreAllRest) {
  const auto model = std::make_shared<const Model>(make_model());
  Reconstructor reconstructor(model);
  std::vector<std::int16_t> depth(model->rectify.entries.size(), 777);
  DrawnTiles drawn;
  const std::vector<std::uint8_t> luma(pixel(0, kFrameHeight, kFrameWidth) + 64, 150);
  reconstructor.run_active(luma.data(), kFrameWidth, TileRows(10), depth, drawn);
  EXPECT_EQ(std::ranges::count(depth, 0), static_cast<std::ptrdiff_t>(depth.size()));
}

DTACT_EVERY_TARGET(ActiveTiles);

}  // namespace
}  // namespace dtact::recon
