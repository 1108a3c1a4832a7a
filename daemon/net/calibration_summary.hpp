#pragma once

#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"

namespace dtact::net {

/// What a calibration is, in a few words: dtact.v1.CalibrationSummary, where units stand.
struct CalibrationSummary {
  std::string name;
  std::string method;  ///< "lut" or "published".
  double mm_per_px = 0;
  int width = 0;  ///< The depth map's at full resolution, pixels.
  int height = 0;
  double covered_from_mm = 0;
  double covered_to_mm = 0;
  std::string created;  ///< ISO 8601, or empty.
  int frame_width = 0;  ///< The camera image's, pixels.
  int frame_height = 0;
  std::vector<int> sharpen_steps;  ///< See recon::sharpening_steps().
  bool operator==(const CalibrationSummary&) const = default;
};

/// Without a model only name and time.
[[nodiscard]] CalibrationSummary summarise(const calibration::Calibration& calibration);

}  // namespace dtact::net
