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

TEST(TileReaders, ACoarseTileReadsSoManyMoreColumns) {
  // 32 columns of the coarse map are 128 of the frame, and 6 more are 24: nine and a half columns
  // of cells. The second tile begins to read at column 104, in the seventh cell.
  RectifyTable table = make_crop_table(256, 256, 0, 0, 256, 256);
  table.decimation = 4;
  table.width = table.height = 64;
  const CellLattice lattice(table);
  const TileReaders readers(lattice, table, 6);
  const auto columns_that_read = [&](int column) {
    std::vector<std::int32_t> active(lattice.at(0, lattice.rows()));
    active[lattice.at(column, 2)] = 1;
    TileRows tiles(static_cast<std::size_t>(readers.grid().rows()));
    readers.mark(active, tiles);
    return tiles.front();
  };
  EXPECT_EQ(columns_that_read(0), 0b01U);
  EXPECT_EQ(columns_that_read(5), 0b01U);
  EXPECT_EQ(columns_that_read(6), 0b11U);
  EXPECT_EQ(columns_that_read(9), 0b11U);
  EXPECT_EQ(columns_that_read(10), 0b10U);
  EXPECT_EQ(columns_that_read(15), 0b10U);
}

TEST(TileReaders, OnlyTheTilesOfActiveCellsAreMarked) {
  const RectifyTable table = make_crop_table(500, 400, 0, 0, 500, 400);
  const CellLattice lattice(table);
  const TileReaders readers(lattice, table, 0);
  std::vector<std::int32_t> active(lattice.at(0, lattice.rows()));
  TileRows tiles(static_cast<std::size_t>(readers.grid().rows()), readers.grid().all());
  readers.mark(active, tiles);
  EXPECT_EQ(count_tiles(tiles), 0) << "what was marked before is forgotten";
  active[lattice.at(5, 20)] = 1;  // pixels 80 to 95, rows 320 to 335
  active[lattice.at(11, 3)] = 1;  // pixels 176 to 191, rows 48 to 63
  readers.mark(active, tiles);
  // The row above a cell reads its first row as the lower neighbour.
  TileRows expected(tiles.size());
  expected[19] = expected[20] = 0b000100U;  // columns 64 to 95
  expected[2] = expected[3] = 0b100000U;    // columns 160 to 191
  EXPECT_EQ(tiles, expected);
}

// A map of 500×400 pixels reads 501×401 with their right and lower neighbours: 32×26 cells.
TEST(CellLattice, CoversWhatTheMapReads) {
  const CellLattice lattice(make_crop_table(640, 480, 100, 60, 500, 400));
  EXPECT_EQ(lattice.columns(), 32);
  EXPECT_EQ(lattice.rows(), 26);
  EXPECT_EQ(lattice.cells(), 832);
  EXPECT_EQ(lattice.frame_width(), 640);
  EXPECT_EQ(lattice.x_of(0), 100);
  EXPECT_EQ(lattice.y_of(0), 60);
  EXPECT_EQ(lattice.x_of(31), 596);
  EXPECT_EQ(lattice.y_of(25), 460);
  EXPECT_FALSE(lattice.last_column_overlaps());
  EXPECT_FALSE(lattice.last_row_overlaps());
  const FrameRegion region = lattice.region();
  EXPECT_EQ(region.x, 100);
  EXPECT_EQ(region.y, 60);
  EXPECT_EQ(region.width, 512);
  EXPECT_EQ(region.height, 416);
}

TEST(CellLattice, MovesIntoTheFrame) {
  // Beside column 640 and below row 480 there is nothing to read.
  const CellLattice lattice(make_crop_table(640, 480, 135, 70, 500, 400));
  EXPECT_EQ(lattice.x_of(0), 128);
  EXPECT_EQ(lattice.y_of(0), 64);
  EXPECT_EQ(lattice.region().width, 512);
  EXPECT_EQ(lattice.region().height, 416);
  EXPECT_FALSE(lattice.last_column_overlaps());
  EXPECT_FALSE(lattice.last_row_overlaps());
}

TEST(CellLattice, OverlapsItsLastCellsWhereTheFrameIsNoMultipleOfACell) {
  // 500 columns are 31 cells and a quarter, 400 rows are 25 cells.
  const CellLattice wide(make_crop_table(500, 400, 0, 0, 500, 400));
  EXPECT_EQ(wide.columns(), 32);
  EXPECT_EQ(wide.rows(), 25);
  EXPECT_TRUE(wide.last_column_overlaps());
  EXPECT_FALSE(wide.last_row_overlaps());
  EXPECT_EQ(wide.x_of(30), 480);
  EXPECT_EQ(wide.x_of(31), 484);
  EXPECT_EQ(wide.region().width, 500);
  EXPECT_EQ(wide.region().height, 400);
  const CellLattice high(make_crop_table(400, 500, 0, 0, 400, 500));
  EXPECT_FALSE(high.last_column_overlaps());
  EXPECT_TRUE(high.last_row_overlaps());
  EXPECT_EQ(high.y_of(31), 484);
}

TEST(CellLattice, AFrameSmallerThanACellHasNone) {
  const CellLattice none(make_crop_table(15, 40, 2, 3, 10, 30));
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(none.region().width, 15);
  EXPECT_EQ(none.region().height, 40);
  EXPECT_TRUE(CellLattice(make_crop_table(40, 15, 2, 3, 30, 10)).empty());
  EXPECT_FALSE(CellLattice(make_crop_table(16, 40, 2, 3, 10, 30)).empty());
  EXPECT_FALSE(CellLattice(make_crop_table(40, 16, 2, 3, 30, 10)).empty());
}

}  // namespace
}  // namespace dtact::recon
