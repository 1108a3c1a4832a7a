#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/cells.hpp"
#include "daemon/recon/rectify.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// Where the cells of vec::kCell pixels lie in the frame: they cover what a table reads.
class CellLattice {
 public:
  CellLattice() = default;
  explicit CellLattice(const RectifyTable& table) noexcept;

  [[nodiscard]] int columns() const noexcept { return columns_; }
  [[nodiscard]] int rows() const noexcept { return rows_; }
  [[nodiscard]] int cells() const noexcept { return columns_ * rows_; }
  /// The frame is smaller than a cell.
  [[nodiscard]] bool empty() const noexcept { return columns_ == 0; }
  /// Values a row of a plane of cells, vec::padded_cells(columns()).
  [[nodiscard]] int stride() const noexcept { return stride_; }
  /// Index of a cell's value in a plane.
  [[nodiscard]] std::size_t at(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(stride_) +
           static_cast<std::size_t>(column);
  }
  /// A cell's upper left pixel in the frame. Cells lie side by side, but where they would reach
  /// beyond the frame: there the last column or row overlaps the one before.
  [[nodiscard]] int x_of(int column) const noexcept;
  [[nodiscard]] int y_of(int row) const noexcept;
  [[nodiscard]] bool last_column_overlaps() const noexcept;
  [[nodiscard]] bool last_row_overlaps() const noexcept;
  [[nodiscard]] int frame_width() const noexcept { return frame_width_; }
  /// What the cells cover; the whole frame if there are none.
  [[nodiscard]] FrameRegion region() const noexcept;

 private:
  int frame_width_ = 0;
  int frame_height_ = 0;
  int x_ = 0;
  int y_ = 0;
  int columns_ = 0;
  int rows_ = 0;
  int stride_ = 0;
};

/// Which tiles of a depth map depend on which cells.
class TileReaders {
 public:
  /// `radius`: how many pixels of the map a result depends on, on every side.
  TileReaders(const CellLattice& lattice, const RectifyTable& table, int radius);

  /// The tiles that read any active cell; all of them where there are no cells. `active`: a plane
  /// of the lattice's cells, 0 where quiet.
  void mark(std::span<const std::int32_t> active, TileRows& tiles) const noexcept;

  [[nodiscard]] const TileGrid& grid() const noexcept { return grid_; }

 private:
  /// Tiles that read a cell, widened by the reach: columns and rows [first, last).
  struct Readers {
    std::int32_t first_column = INT32_MAX;
    std::int32_t last_column = 0;
    std::int32_t first_row = INT32_MAX;
    std::int32_t last_row = 0;
  };

  CellLattice lattice_;
  TileGrid grid_;
  std::vector<Readers> readers_;
};

}  // namespace dtact::recon
