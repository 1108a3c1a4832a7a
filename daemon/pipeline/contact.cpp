#include "daemon/pipeline/contact.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

struct RowCounts {
  int made = 0;
  int lost = 0;
  std::int16_t deepest = recon::kUntrusted;
};

/// kUntrusted is the least int16, so it falls below every threshold without being asked for.
RowCounts count_row(const std::int16_t* row, int width, std::int16_t made_um,
                    std::int16_t lost_um) noexcept {
  RowCounts counts;
  for (int x = 0; x < width; ++x) {
    counts.made += row[x] > made_um ? 1 : 0;
    counts.lost += row[x] > lost_um ? 1 : 0;
    counts.deepest = std::max(counts.deepest, row[x]);
  }
  return counts;
}

std::int16_t micrometres(double mm) noexcept {
  return static_cast<std::int16_t>(std::clamp(std::lround(mm * 1000.0), -32767L, 32767L));
}

}  // namespace

ContactSummary ContactDetector::inspect(std::span<const std::int16_t> depth_um, int width,
                                        double mm_per_px) noexcept {
  const std::int16_t made_um = micrometres(rules_.made_mm);
  const std::int16_t lost_um = micrometres(rules_.lost_mm);
  const int height = width > 0 ? static_cast<int>(depth_um.size()) / width : 0;
  std::int64_t made = 0;
  std::int64_t lost = 0;
  std::int64_t sum_um = 0;
  std::int64_t sum_x = 0;
  std::int64_t sum_y = 0;
  int deepest_um = recon::kUntrusted;
  int deepest_x = 0;
  int deepest_y = 0;
  for (int y = 0; y < height; ++y) {
    const std::int16_t* row = depth_um.data() + std::ptrdiff_t{y} * width;
    const RowCounts counts = count_row(row, width, made_um, lost_um);
    made += counts.made;
    lost += counts.lost;
    if (counts.deepest > deepest_um) {
      deepest_um = counts.deepest;
      deepest_x = static_cast<int>(std::find(row, row + width, counts.deepest) - row);
      deepest_y = y;
    }
    if (counts.made == 0) continue;
    std::int64_t row_um = 0;
    for (int x = 0; x < width; ++x) {
      const std::int64_t um = row[x] > made_um ? row[x] : 0;
      row_um += um;
      sum_x += um * x;
    }
    sum_um += row_um;
    sum_y += row_um * y;
  }

  const double px_mm2 = mm_per_px * mm_per_px;
  decide(static_cast<double>(made) * px_mm2, static_cast<double>(lost) * px_mm2);

  const double centre_x = 0.5 * (width - 1);
  const double centre_y = 0.5 * (height - 1);
  ContactSummary summary;
  summary.touching = touching_;
  summary.area_mm2 = static_cast<double>(made) * px_mm2;
  if (sum_um > 0) {
    const auto weight = static_cast<double>(sum_um);
    summary.x_mm = (static_cast<double>(sum_x) / weight - centre_x) * mm_per_px;
    summary.y_mm = (static_cast<double>(sum_y) / weight - centre_y) * mm_per_px;
    summary.volume_mm3 = weight / 1000.0 * px_mm2;
  }
  if (deepest_um != recon::kUntrusted) {
    summary.deepest_mm = deepest_um / 1000.0;
    summary.deepest_x_mm = (deepest_x - centre_x) * mm_per_px;
    summary.deepest_y_mm = (deepest_y - centre_y) * mm_per_px;
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
