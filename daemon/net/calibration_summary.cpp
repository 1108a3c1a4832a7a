#include "daemon/net/calibration_summary.hpp"

#include <algorithm>
#include <cstddef>

#include "daemon/recon/reconstructor.hpp"

namespace dtact::net {

CalibrationSummary summarise(const calibration::Calibration& calibration) {
  CalibrationSummary summary;
  summary.name = calibration.name;
  summary.created = calibration.origin.created;
  if (calibration.model == nullptr) return summary;
  const recon::Model& model = *calibration.model;
  summary.method = model.method == recon::Method::published ? "published" : "lut";
  summary.mm_per_px = model.mm_per_px;
  summary.width = model.rectify.width;
  summary.height = model.rectify.height;
  const auto depth_at = [&lut = model.lut](int q6) {
    if (lut.um.empty()) return 0.0;
    const int last = static_cast<int>(lut.um.size()) - 1;
    return lut.um[static_cast<std::size_t>(std::clamp(q6 - lut.first_q6, 0, last))] / 1000.0;
  };
  summary.covered_from_mm = depth_at(model.lut.covered_from_q6);
  summary.covered_to_mm = depth_at(model.lut.covered_to_q6);
  summary.frame_width = model.rectify.frame_width;
  summary.frame_height = model.rectify.frame_height;
  summary.sharpen_steps = recon::sharpening_steps(model);
  return summary;
}

}  // namespace dtact::net
