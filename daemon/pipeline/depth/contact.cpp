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
                                        double mm_per_px, const recon::Viewpoint& view) noexcept {
  const double px_mm2 = mm_per_px * mm_per_px;
  decide(static_cast<double>(sums.made) * px_mm2, static_cast<double>(sums.lost) * px_mm2);

  const double centre_x = 0.5 * (width - 1);
  const double centre_y = 0.5 * (height - 1);
  ContactSummary summary;
  summary.in_contact = in_contact_;
  summary.threshold_mm = rules_.threshold_mm;
  // What is deeper than h covers (1 − h / height)² of the area in which it is seen, and its
  // distance from the axis's foot is 1 − h / height of that. Integrated over h, depth counts d − d²
  // / height for the volume and d − 3/2 d² / height for the first moment.
  const double rim = 1 - view.per_mm * rules_.threshold_mm;
  summary.area_mm2 = static_cast<double>(sums.made) * px_mm2 * rim * rim;
  if (sums.um > 0) {
    const auto depth = static_cast<double>(sums.um);
    const double share = view.per_mm * 1e-3 * 2 * recon::DepthSums::kSquareUm2;  // of even rows
    const double bent = share * static_cast<double>(sums.square);
    const auto place = [&](std::int64_t um, std::int64_t square, double centre, double foot_mm) {
      const double foot = foot_mm / mm_per_px + centre;
      const double moment = static_cast<double>(um) - foot * depth;
      const double bent_moment = share * static_cast<double>(square) - foot * bent;
      return foot_mm + mm_per_px * (moment - 1.5 * bent_moment) / (depth - bent);
    };
    summary.x_mm = place(sums.um_x, sums.square_x, centre_x, view.foot_mm.x);
    summary.y_mm = place(sums.um_y, sums.square_y, centre_y, view.foot_mm.y);
    summary.volume_mm3 = (depth - bent) / 1000.0 * px_mm2;
  }
  if (sums.deepest_um != recon::kUntrusted) {
    summary.deepest_mm = sums.deepest_um / 1000.0;
    const recon::Point deepest = view.place(
        {(sums.deepest_x - centre_x) * mm_per_px, (sums.deepest_y - centre_y) * mm_per_px},
        summary.deepest_mm);
    summary.deepest_x_mm = deepest.x;
    summary.deepest_y_mm = deepest.y;
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
