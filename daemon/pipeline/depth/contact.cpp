#include "daemon/pipeline/depth/contact.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

std::int16_t micrometres(double mm) noexcept {
  return static_cast<std::int16_t>(std::clamp(std::lround(mm * 1000.0), -32767L, 32767L));
}

}  // namespace

recon::SumRules ContactDetector::sum_rules() const noexcept {
  recon::SumRules rules;
  rules.threshold_um = micrometres(rules_.threshold_mm);
  rules.release_um = micrometres(rules_.release_mm);
  return rules;
}

ContactSummary ContactDetector::inspect(const recon::DepthSums& sums, int width, int height,
                                        double mm_per_px) noexcept {
  const double px_mm2 = mm_per_px * mm_per_px;
  decide(static_cast<double>(sums.made) * px_mm2, static_cast<double>(sums.lost) * px_mm2);

  const double centre_x = 0.5 * (width - 1);
  const double centre_y = 0.5 * (height - 1);
  ContactSummary summary;
  summary.in_contact = in_contact_;
  summary.threshold_mm = rules_.threshold_mm;
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
  const bool other = in_contact_ ? lost_mm2 < rules_.area_mm2 : made_mm2 >= rules_.area_mm2;
  agreeing_ = other ? agreeing_ + 1 : 0;
  if (agreeing_ >= rules_.debounce_frames) {
    in_contact_ = !in_contact_;
    agreeing_ = 0;
  }
}

}  // namespace dtact::pipeline
