#pragma once

#include <functional>
#include <string>
#include <vector>

namespace dtact::bench {

/// One thing that is timed.
struct Case {
  std::string name;
  std::function<void()> once;  ///< Does it once.
  /// Checks what it gives; empty when right, else what is not.
  std::function<std::string()> verify;
  double share = 1;  ///< Of the map's pixels that are computed.
};

/// The names of all cases.
[[nodiscard]] std::vector<std::string> case_names();

/// Throws std::runtime_error where no case has that name. Cases share their inputs, which live as
/// long as the process.
[[nodiscard]] Case make_case(const std::string& name);

/// Writes what the Python pipeline reads to `folder`: frame.raw, reference.raw (8-bit grey),
/// frame.jpg, map_x.f32, map_y.f32, list.f32 (millimetres of 0 … 255 levels).
void export_inputs(const std::string& folder);

/// Millimetres of a darkening of 0 … 255 whole grey levels: the model's list, for others.
[[nodiscard]] std::vector<float> lut_mm_of();

}  // namespace dtact::bench
