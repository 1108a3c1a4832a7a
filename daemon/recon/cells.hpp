#pragma once

#include <cstddef>
#include <cstdint>

/// Sums over square cells of the raw frame: what the comparison with the reference image works on.
namespace dtact::recon::vec {

inline constexpr int kCell = 16;  ///< Side of a cell, pixels.
/// Only every second row is read: the gel blurs over several, and the look is half as dear.
inline constexpr int kRowStep = 2;
inline constexpr int kCellPixels = kCell * kCell / kRowStep;  ///< Read of a cell.
inline constexpr int kRoughPixels = 2 * kCell;                ///< pixels for the roughness

/// Sums up one row of `cells` adjacent cells that begins at `luma`, rows `stride` bytes apart.
/// sum[i]: sum of grey levels of cell i; upper[i]: that of its upper half. rough[i]:
/// |difference| of its rows 0 and 2 plus that of its rows 8 and 10, summed over kRoughPixels
/// pairs of pixels. For white noise the mean is 1.128 standard deviations. The number of pixels
/// that are `clipped` or brighter is added to `saturated`.
void sum_cells(const std::uint8_t* luma, std::ptrdiff_t stride, int cells, std::uint8_t clipped,
               std::int32_t* sum, std::int32_t* upper, std::int32_t* rough,
               std::int64_t& saturated) noexcept;

/// Rows of cells are stored in multiples of this, with at least one cell of zeros at the end.
inline constexpr int kCellBlock = 16;
[[nodiscard]] constexpr int padded_cells(int columns) noexcept {
  return (columns + kCellBlock) / kCellBlock * kCellBlock;
}

/// Planes of int32, `stride` values a row, whose columns beyond the cells hold zeros. `change`,
/// `window` and `active` have kCellBlock + stride more values before and after. Flags are 0 or −1.
struct CellPlanes {
  int stride = 0;  ///< padded_cells(columns).
  int rows = 0;
  /// Windows that begin beyond these are left out: no neighbour, or one that overlaps.
  int window_columns = 0;
  int window_rows = 0;
  const std::int32_t* sum = nullptr;
  const std::int32_t* sum_before = nullptr;  ///< the previous frame's
  const std::int32_t* expected = nullptr;    ///< Mean grey, Q16.
  std::int32_t* change = nullptr;            ///< Out: sum's mean − expected, Q16.
  std::int32_t* cell = nullptr;              ///< In and out: the cell's own change is active.
  std::int32_t* window = nullptr;  ///< The same of the mean of it, its right and lower neighbours.
  std::int32_t* active = nullptr;  ///< Out: active by itself or in any window. In: as it was.
};

/// |change| in Q16 above which a quiet cell or window becomes active, and above which it stays so.
struct ChangeLimits {
  std::int32_t cell_on = 0;
  std::int32_t cell_off = 0;
  std::int32_t window_on = 0;
  std::int32_t window_off = 0;
};

/// Sums over cells; "quiet" are those that were not active before.
struct CellTotals {
  std::int64_t grey = 0;          ///< of `sum`
  std::int64_t quiet_change = 0;  ///< of `change`, Q8
  std::int64_t quiet_step = 0;    ///< Of |sum − sum_before|.
  int active = 0;                 ///< Cells now.
};

[[nodiscard]] CellTotals compare_cells(const CellPlanes& planes,
                                       const ChangeLimits& limits) noexcept;

}  // namespace dtact::recon::vec
