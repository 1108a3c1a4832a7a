#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/recon/rectify_plan.hpp"

namespace dtact::recon {

/// The depth map cut into tiles of 16 rows and 32 columns (a multiple of 32 for maps wider than
/// 2048 pixels, so that a row of tiles is one word).
struct TileGrid {
  static constexpr int kRows = 16;  ///< Pixel rows of a tile.

  int width = 0;            ///< Pixels of the map.
  int height = 0;           ///< Pixels of the map.
  int blocks_per_tile = 1;  ///< Width of a tile in the kernels' blocks of 32 pixels.

  TileGrid() = default;
  TileGrid(int map_width, int map_height) noexcept
      : width(map_width), height(map_height), blocks_per_tile((blocks() + kWord - 1) / kWord) {}

  [[nodiscard]] int blocks() const noexcept {
    return (width + RectifyPlan::kBlock - 1) / RectifyPlan::kBlock;
  }
  [[nodiscard]] int columns() const noexcept {
    return (blocks() + blocks_per_tile - 1) / blocks_per_tile;
  }
  [[nodiscard]] int rows() const noexcept { return (height + kRows - 1) / kRows; }
  [[nodiscard]] int tile_width() const noexcept { return blocks_per_tile * RectifyPlan::kBlock; }
  /// A row in which every tile is set.
  [[nodiscard]] std::uint64_t all() const noexcept {
    return ~std::uint64_t{0} >> (kWord - columns());
  }
  bool operator==(const TileGrid&) const = default;

 private:
  static constexpr int kWord = 64;
};

/// A set of tiles: a word for each row of tiles, bit 0 the leftmost.
using TileRows = std::vector<std::uint64_t>;

[[nodiscard]] inline int count_tiles(const TileRows& tiles) noexcept {
  int count = 0;
  for (const std::uint64_t row : tiles) count += std::popcount(row);
  return count;
}

/// Calls visit(first, last) for each run of set bits [first, last).
template <typename Visit>
void for_each_run(std::uint64_t row, Visit visit) {
  int first = 0;
  while (row >> first != 0) {
    first += std::countr_zero(row >> first);
    const int last = first + std::countr_one(row >> first);
    visit(first, last);
    if (last == 64) return;
    first = last;
  }
}

}  // namespace dtact::recon
