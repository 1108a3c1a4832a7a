#include "daemon/pipeline/reference/luma_grid.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::pipeline {
namespace {

/// Pixel rows `row(y)` of `width` × `height` values in units of 1/unit grey levels.
template <typename RowOf>
void measure_rows(RowOf row, int width, int height, float unit, LumaGrid& grid) noexcept {
  double total = 0;
  std::size_t cell = 0;
  for (int j = 0; j < kGridHeight; ++j) {
    const int y0 = cell_edge(j, kGridHeight, height);
    const int y1 = cell_edge(j + 1, kGridHeight, height);
    std::array<std::uint64_t, kGridWidth> sums{};
    for (int y = y0; y < y1; ++y) {
      const auto* pixels = row(y);
      for (int i = 0; i < kGridWidth; ++i) {
        const int x1 = cell_edge(i + 1, kGridWidth, width);
        std::uint32_t sum = 0;
        for (int x = cell_edge(i, kGridWidth, width); x < x1; ++x) sum += pixels[x];
        sums[static_cast<std::size_t>(i)] += sum;
      }
    }
    for (int i = 0; i < kGridWidth; ++i, ++cell) {
      const int columns = cell_edge(i + 1, kGridWidth, width) - cell_edge(i, kGridWidth, width);
      const float pixels = static_cast<float>(columns) * static_cast<float>(y1 - y0);
      grid.cells[cell] = static_cast<float>(sums[static_cast<std::size_t>(i)]) / (pixels * unit);
      total += grid.cells[cell];
    }
  }
  grid.mean = static_cast<float>(total / static_cast<double>(kGridCells));
}

}  // namespace

void measure(const hal::LumaView& luma, LumaGrid& grid) noexcept {
  measure_rows([&](int y) { return luma.row(y); }, luma.width, luma.height, 1.0F, grid);
}

void measure(std::span<const std::uint16_t> reference_q8, int width, int height,
             LumaGrid& grid) noexcept {
  measure_rows([&](int y) { return reference_q8.data() + std::ptrdiff_t{y} * width; }, width,
               height, 256.0F, grid);
}

float greatest_change(const LumaGrid& a, const LumaGrid& b, const CellRegion& region) noexcept {
  float greatest = 0;
  for (int y = region.y0; y < region.y1; ++y) {
    for (int x = region.x0; x < region.x1; ++x) {
      const std::size_t cell = cell_at(x, y);
      greatest = std::max(greatest, std::abs(a.cells[cell] - b.cells[cell]));
    }
  }
  return greatest;
}

}  // namespace dtact::pipeline
