#include "daemon/net/calibration_summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "daemon/recon/reconstructor.hpp"

namespace dtact::net {

CalibrationSummary summarise(const calibration::Calibration& calibration) {
  CalibrationSummary summary;
  summary.name = calibration.name;
  summary.created = calibration.origin.created;
  if (calibration.model == nullptr) return summary;
  const recon::Model& model = *calibration.model;
  summary.method = model.method == recon::Method::published ? "published" : "lut";
  const int scale = model.frame_scale;
  summary.mm_per_px = model.mm_per_px / scale;
  summary.width = model.rectify.width * scale;
  summary.height = model.rectify.height * scale;
  const auto depth_at = [&lut = model.lut](int q6) {
    if (lut.um.empty()) return 0.0;
    const int last = static_cast<int>(lut.um.size()) - 1;
    return lut.um[static_cast<std::size_t>(std::clamp(q6 - lut.first_q6, 0, last))] / 1000.0;
  };
  summary.covered_from_mm = depth_at(model.lut.covered_from_q6);
  summary.covered_to_mm = depth_at(model.lut.covered_to_q6);
  summary.frame_width = model.rectify.frame_width * scale;
  summary.frame_height = model.rectify.frame_height * scale;
  summary.sharpen_steps = recon::sharpening_steps(model);
  return summary;
}

std::string format(const CalibrationSummary& summary) {
  return fmt::format(
      "method = {}\nmm_per_px = {}\nwidth = {}\nheight = {}\ncovered_from_mm = {}\n"
      "covered_to_mm = {}\ncreated = {}\nframe_width = {}\nframe_height = {}\n"
      "sharpen_steps = [{}]\n",
      tomlfile::quoted(summary.method), summary.mm_per_px, summary.width, summary.height,
      summary.covered_from_mm, summary.covered_to_mm, tomlfile::quoted(summary.created),
      summary.frame_width, summary.frame_height, fmt::join(summary.sharpen_steps, ", "));
}

CalibrationSummary read_summary(tomlfile::KeyReader& reader, std::string name) {
  constexpr double kAnyMm = 1e6;
  const auto integer = [&](const char* key) {
    return static_cast<int>(reader.integer(key, 0, INT_MAX));
  };
  CalibrationSummary summary;
  summary.name = std::move(name);
  summary.method = reader.text("method");
  summary.mm_per_px = reader.number("mm_per_px", 0, kAnyMm);
  summary.width = integer("width");
  summary.height = integer("height");
  summary.covered_from_mm = reader.number("covered_from_mm", -kAnyMm, kAnyMm);
  summary.covered_to_mm = reader.number("covered_to_mm", -kAnyMm, kAnyMm);
  summary.created = reader.text("created");
  summary.frame_width = integer("frame_width");
  summary.frame_height = integer("frame_height");
  for (const std::int64_t steps : reader.integers("sharpen_steps", 0, INT_MAX)) {
    summary.sharpen_steps.push_back(static_cast<int>(steps));
  }
  return summary;
}

}  // namespace dtact::net
