#include "daemon/recon/tile_readers.hpp"

#include <algorithm>
#include <numeric>

namespace dtact::recon {
namespace {

constexpr int kCell = vec::kCell;

}  // namespace

CellLattice::CellLattice(const RectifyTable& table) noexcept
    : frame_width_(table.frame_width), frame_height_(table.frame_height) {
  if (frame_width_ < kCell || frame_height_ < kCell) return;
  const FrameRegion read = region_read(table);
  columns_ = (read.width + kCell - 1) / kCell;
  rows_ = (read.height + kCell - 1) / kCell;
  x_ = std::clamp(read.x, 0, std::max(0, frame_width_ - columns_ * kCell));
  y_ = std::clamp(read.y, 0, std::max(0, frame_height_ - rows_ * kCell));
  stride_ = vec::padded_cells(columns_);
}

int CellLattice::x_of(int column) const noexcept {
  return std::min(x_ + column * kCell, frame_width_ - kCell);
}

int CellLattice::y_of(int row) const noexcept {
  return std::min(y_ + row * kCell, frame_height_ - kCell);
}

bool CellLattice::last_column_overlaps() const noexcept {
  return x_ + columns_ * kCell > frame_width_;
}

bool CellLattice::last_row_overlaps() const noexcept { return y_ + rows_ * kCell > frame_height_; }

FrameRegion CellLattice::region() const noexcept {
  if (empty()) return {0, 0, frame_width_, frame_height_};
  return {x_, y_, x_of(columns_ - 1) + kCell - x_, y_of(rows_ - 1) + kCell - y_};
}

TileReaders::TileReaders(const CellLattice& lattice, const RectifyTable& table, int radius)
    : lattice_(lattice), grid_(table.width, table.height), readers_(lattice.at(0, lattice.rows())) {
  if (lattice_.empty()) return;
  const FrameRegion region = lattice_.region();
  for (int row = 0; row < grid_.rows(); ++row) {
    for (int column = 0; column < grid_.columns(); ++column) {
      const int left = std::max(0, column * grid_.tile_width() - radius);
      const int right = std::min(grid_.width, (column + 1) * grid_.tile_width() + radius);
      const int top = std::max(0, row * TileGrid::kRows - radius);
      const int bottom = std::min(grid_.height, (row + 1) * TileGrid::kRows + radius);
      int x0 = INT16_MAX;
      int x1 = 0;
      int y0 = INT16_MAX;
      int y1 = 0;
      for (int y = top * table.decimation; y < bottom * table.decimation; ++y) {
        for (int x = left * table.decimation; x < right * table.decimation; ++x) {
          const RectifyTable::Entry& e =
              table.entries[static_cast<std::size_t>(y) *
                                static_cast<std::size_t>(table.fine_width()) +
                            static_cast<std::size_t>(x)];
          x0 = std::min<int>(x0, e.x);
          x1 = std::max(x1, e.x + 1);
          y0 = std::min<int>(y0, e.y);
          y1 = std::max(y1, e.y + 1);
        }
      }
      const int last_row = std::min((y1 - region.y) / kCell, lattice_.rows() - 1);
      const int last_column = std::min((x1 - region.x) / kCell, lattice_.columns() - 1);
      for (int cy = (y0 - region.y) / kCell; cy <= last_row; ++cy) {
        for (int cx = (x0 - region.x) / kCell; cx <= last_column; ++cx) {
          Readers& readers = readers_[lattice_.at(cx, cy)];
          readers = {std::min(readers.first_column, column),
                     std::max(readers.last_column, column + 1), std::min(readers.first_row, row),
                     std::max(readers.last_row, row + 1)};
        }
      }
    }
  }
}

void TileReaders::mark(std::span<const std::int32_t> active, TileRows& tiles) const noexcept {
  if (lattice_.empty()) {
    std::ranges::fill(tiles, grid_.all());
    return;
  }
  std::ranges::fill(tiles, std::uint64_t{0});
  for (int row = 0; row < lattice_.rows(); ++row) {
    const auto flags =
        active.subspan(lattice_.at(0, row), static_cast<std::size_t>(lattice_.columns()));
    if (std::accumulate(flags.begin(), flags.end(), 0) == 0) continue;
    for (int column = 0; column < lattice_.columns(); ++column) {
      if (flags[static_cast<std::size_t>(column)] == 0) continue;
      const Readers& readers = readers_[lattice_.at(column, row)];
      if (readers.first_column >= readers.last_column) continue;
      const std::uint64_t columns = (~std::uint64_t{0} << readers.first_column) &
                                    (~std::uint64_t{0} >> (64 - readers.last_column));
      for (int tile = readers.first_row; tile < readers.last_row; ++tile) {
        tiles[static_cast<std::size_t>(tile)] |= columns;
      }
    }
  }
}

}  // namespace dtact::recon
