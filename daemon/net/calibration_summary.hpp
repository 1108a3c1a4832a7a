#pragma once

#include <string>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "hal/files/key_reader.hpp"

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

/// A summary as the keys of a TOML file, without its name.
[[nodiscard]] std::string format(const CalibrationSummary& summary);
/// Takes the keys that format() writes. Throws as KeyReader.
[[nodiscard]] CalibrationSummary read_summary(tomlfile::KeyReader& reader, std::string name);

}  // namespace dtact::net
