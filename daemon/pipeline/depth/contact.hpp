#pragma once

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/pipeline_config.hpp"
#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/surface.hpp"

namespace dtact::pipeline {

/// Detects contact in a depth map, with hysteresis. Contact begins when the area deeper
/// than `threshold_mm` reaches `area_mm2` and ends when that deeper than `release_mm` is smaller,
/// each after `debounce_frames` frames in a row. Untrusted pixels are ignored.
class ContactDetector {
 public:
  explicit ContactDetector(const ContactRules& rules) : rules_(rules) {}

  /// What the reconstruction has to sum up; no bend.
  [[nodiscard]] recon::SumRules sum_rules() const noexcept;

  /// What one depth map of `width` × `height` pixels, `mm_per_px` millimetres each, added up to by
  /// sum_rules(). The summary is in millimetres in the surface frame: origin at the map's centre, x
  /// right, y down. Area, centroid and volume are those of the pixels deeper than `threshold_mm`,
  /// at their true places as `view` says.
  [[nodiscard]] ContactSummary inspect(const recon::DepthSums& sums, int width, int height,
                                       double mm_per_px, const recon::Viewpoint& view) noexcept;

  [[nodiscard]] bool in_contact() const noexcept { return in_contact_; }

 private:
  void decide(double made_mm2, double lost_mm2) noexcept;

  ContactRules rules_;
  bool in_contact_ = false;
  int agreeing_ = 0;  // consecutive frames that contradict the present state
};

}  // namespace dtact::pipeline
