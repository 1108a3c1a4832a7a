#include "daemon/pipeline/depth/contact.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

struct RunCounts {
  int made = 0;
  int lost = 0;
  std::int16_t deepest = recon::kUntrusted;
};

/// kUntrusted is the least int16, so it falls below every threshold without being asked for.
RunCounts count_run(const std::int16_t* run, int width, std::int16_t made_um,
                    std::int16_t lost_um) noexcept {
  RunCounts counts;
  for (int x = 0; x < width; ++x) {
    counts.made += run[x] > made_um ? 1 : 0;
    counts.lost += run[x] > lost_um ? 1 : 0;
    counts.deepest = std::max(counts.deepest, run[x]);
  }
  return counts;
}

/// What the pixels of a map add up to, in pixels and micrometres.
struct Sums {
  std::int64_t made = 0;
  std::int64_t lost = 0;
  std::int64_t um = 0;
  std::int64_t um_x = 0;
  std::int64_t um_y = 0;
  int deepest_um = recon::kUntrusted;
  int deepest_x = 0;
  int deepest_y = 0;

  /// Pixels [x0, x1) of row `y`, which begins at `row`.
  void add(const std::int16_t* row, int y, int x0, int x1, std::int16_t made_um,
           std::int16_t lost_um) noexcept {
    const RunCounts counts = count_run(row + x0, x1 - x0, made_um, lost_um);
    made += counts.made;
    lost += counts.lost;
    if (counts.deepest > deepest_um) {
      deepest_um = counts.deepest;
      deepest_x = static_cast<int>(std::find(row + x0, row + x1, counts.deepest) - row);
      deepest_y = y;
    }
    if (counts.made == 0) return;
    std::int64_t run_um = 0;
    std::int64_t run_um_x = 0;
    for (int x = x0; x < x1; ++x) {
      const std::int64_t depth = row[x] > made_um ? row[x] : 0;
      run_um += depth;
      run_um_x += depth * x;
    }
    um += run_um;
    um_x += run_um_x;
    um_y += run_um * y;
  }
};

std::int16_t micrometres(double mm) noexcept {
  return static_cast<std::int16_t>(std::clamp(std::lround(mm * 1000.0), -32767L, 32767L));
}

}  // namespace

ContactSummary ContactDetector::inspect(std::span<const std::int16_t> depth_um,
                                        const recon::TileGrid& grid, const recon::TileRows& drawn,
                                        double mm_per_px) noexcept {
  const std::int16_t made_um = micrometres(rules_.made_mm);
  const std::int16_t lost_um = micrometres(rules_.lost_mm);
  const int width = grid.width;
  const int height = grid.height;
  Sums sums;
  for (int y = 0; y < height; ++y) {
    recon::for_each_run(
        drawn[static_cast<std::size_t>(y / recon::TileGrid::kRows)], [&](int first, int last) {
          sums.add(depth_um.data() + std::ptrdiff_t{y} * width, y, first * grid.tile_width(),
                   std::min(last * grid.tile_width(), width), made_um, lost_um);
        });
  }

  const double px_mm2 = mm_per_px * mm_per_px;
  decide(static_cast<double>(sums.made) * px_mm2, static_cast<double>(sums.lost) * px_mm2);

  const double centre_x = 0.5 * (width - 1);
  const double centre_y = 0.5 * (height - 1);
  ContactSummary summary;
  summary.touching = touching_;
  summary.area_mm2 = static_cast<double>(sums.made) * px_mm2;
  if (sums.um > 0) {
    const auto weight = static_cast<double>(sums.um);
    summary.x_mm = (static_cast<double>(sums.um_x) / weight - centre_x) * mm_per_px;
    summary.y_mm = (static_cast<double>(sums.um_y) / weight - centre_y) * mm_per_px;
    summary.volume_mm3 = weight / 1000.0 * px_mm2;
  }
  if (sums.deepest_um != recon::kUntrusted) {
    summary.deepest_mm = sums.deepest_um / 1000.0;
    summary.deepest_x_mm = (sums.deepest_x - centre_x) * mm_per_px;
    summary.deepest_y_mm = (sums.deepest_y - centre_y) * mm_per_px;
  }
  return summary;
}

void ContactDetector::decide(double made_mm2, double lost_mm2) noexcept {
  const bool other = touching_ ? lost_mm2 < rules_.area_mm2 : made_mm2 >= rules_.area_mm2;
  agreeing_ = other ? agreeing_ + 1 : 0;
  if (agreeing_ >= rules_.debounce_frames) {
    touching_ = !touching_;
    agreeing_ = 0;
  }
}

void ContactDetector::reset() noexcept {
  touching_ = false;
  agreeing_ = 0;
}

}  // namespace dtact::pipeline
