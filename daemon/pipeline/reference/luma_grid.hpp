#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/frame.hpp"

namespace dtact::pipeline {

inline constexpr int kGridWidth = 40;
inline constexpr int kGridHeight = 30;
inline constexpr std::size_t kGridCells = std::size_t{kGridWidth} * kGridHeight;
/// Smaller frames have no meaningful grid.
inline constexpr int kMinFrameWidth = 2 * kGridWidth;
inline constexpr int kMinFrameHeight = 2 * kGridHeight;

/// A frame at low resolution: the mean grey of each of 40×30 cells, about 1 mm a side on the
/// known sensors. Averaging 400 pixels leaves 0.05 grey levels of noise, and a contact covers a
/// cell or more. The cells of recon::CellLattice cannot serve here: they cover only what the map
/// reads and grow in number with the frame, while ContactCheck fits the whole frame at a bounded
/// cost.
struct LumaGrid {
  std::array<float, kGridCells> cells{};  ///< Grey levels, row-major.
  float mean = 0;                         ///< over all cells
};

/// Cell boundaries: cell i of `cells` covers the pixels [edge(i), edge(i + 1)) of `pixels`.
[[nodiscard]] constexpr int cell_edge(int i, int cells, int pixels) noexcept {
  return i * pixels / cells;
}

/// Where the cell in column x, row y stands.
[[nodiscard]] constexpr std::size_t cell_at(int x, int y) noexcept {
  return static_cast<std::size_t>(y) * kGridWidth + static_cast<std::size_t>(x);
}

/// Frame of at least kMinFrameWidth × kMinFrameHeight.
void measure(const hal::LumaView& luma, LumaGrid& grid) noexcept;

/// The same of a reference: Q8 luma, row-major without padding, width × height.
void measure(std::span<const std::uint16_t> reference_q8, int width, int height,
             LumaGrid& grid) noexcept;

/// Cells [x0, x1) × [y0, y1).
struct CellRegion {
  int x0 = 0;
  int y0 = 0;
  int x1 = kGridWidth;
  int y1 = kGridHeight;
  bool operator==(const CellRegion&) const = default;
};

/// The greatest change of any cell in the region, grey levels.
[[nodiscard]] float greatest_change(const LumaGrid& a, const LumaGrid& b,
                                    const CellRegion& region) noexcept;

}  // namespace dtact::pipeline
