#include "daemon/recon/tile_readers.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dtact::recon {
namespace {

/// Column 0 of the rows of tiles that read the cell.
std::vector<bool> rows_that_read(const RectifyTable& table, int radius, int column, int row) {
  const CellLattice lattice(table);
  const TileReaders readers(lattice, table, radius);
  std::vector<std::int32_t> active(lattice.at(0, lattice.rows()));
  active[lattice.at(column, row)] = 1;
  TileRows tiles(static_cast<std::size_t>(readers.grid().rows()));
  readers.mark(active, tiles);
  std::vector<bool> read;
  for (const std::uint64_t of_row : tiles) read.push_back((of_row & 1U) != 0);
  return read;
}

TEST(TileReaders, ATileReadsItsRadiusMoreOnEverySide) {
  // A lens that shows one and a half pixels of the frame for each of the map: the first tile of 32
  // columns ends at column 48 of the frame, where the fourth cell begins.
  RectifyTable table = make_crop_table(256, 128, 0, 0, 160, 64);
  for (int i = 0; auto& entry : table.entries)
    entry.x = static_cast<std::int16_t>(i++ % 160 * 3 / 2);
  EXPECT_FALSE(rows_that_read(table, 0, 3, 0)[0]);
  EXPECT_TRUE(rows_that_read(table, 6, 3, 0)[0]);
  EXPECT_FALSE(rows_that_read(table, 6, 4, 0)[0]);
}

TEST(TileReaders, ACoarseTileReadsSoManyMoreRows) {
  // 16 rows of the coarse map are 64 of the frame, and 6 more are 24: five and a half rows of
  // cells.
  RectifyTable table = make_crop_table(256, 256, 0, 0, 256, 256);
  table.decimation = 4;
  table.width = table.height = 64;
  EXPECT_EQ(rows_that_read(table, 6, 0, 1), (std::vector{true, false, false, false}));
  EXPECT_EQ(rows_that_read(table, 6, 0, 5), (std::vector{true, true, false, false}));
  EXPECT_EQ(rows_that_read(table, 6, 0, 8), (std::vector{false, true, true, false}));
}

}  // namespace
}  // namespace dtact::recon
