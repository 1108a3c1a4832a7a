#include "daemon/recon/depth_sums.hpp"

#include <algorithm>
#include <cstddef>

#include "daemon/recon/vector_kernels.hpp"

namespace dtact::recon {

void StripSums::finished(int row) noexcept {
  const int end = std::min((row + 1) * TileGrid::kRows, grid_.height);
  for_each_run(tiles_[static_cast<std::size_t>(row)], [&](int first, int last) {
    vec::sum_rows(depth_um_, grid_.width, first * grid_.tile_width(),
                  std::min(last * grid_.tile_width(), grid_.width), row * TileGrid::kRows, end,
                  sums_);
  });
  if (sums_.rules.bend_reach == 0) return;
  for (; bend_y_ + sums_.rules.bend_reach < end; bend_y_ += sums_.rules.bend_step()) bend(bend_y_);
}

void StripSums::bend(int y) noexcept {
  const int reach = sums_.rules.bend_reach;
  const auto row = static_cast<std::size_t>(y / TileGrid::kRows);
  for_each_run(tiles_[row], [&](int first, int last) {
    const int x0 = std::max(first * grid_.tile_width(), reach);
    const int x1 = std::min(last * grid_.tile_width(), grid_.width - reach);
    if (x0 >= x1) return;
    vec::bend_row(depth_um_ + std::ptrdiff_t{y} * grid_.width, grid_.width, x0, x1, sums_);
  });
}

}  // namespace dtact::recon
