#pragma once

#include <functional>
#include <string>
#include <vector>

namespace dtact::bench {

/// One timed piece of work.
struct Case {
  std::string name;
  std::function<void()> once;  ///< Runs it once.
  /// Checks the result; empty when right, else the error.
  std::function<std::string()> verify;
  double share = 1;  ///< Share of the map's pixels that are computed.
};

/// The names of all cases.
[[nodiscard]] std::vector<std::string> case_names();

/// Throws std::runtime_error for an unknown name. Cases share their inputs, which live as
/// long as the process.
[[nodiscard]] Case make_case(const std::string& name);

/// Writes the Python pipeline's input to `folder`: frame.raw, reference.raw (8-bit grey),
/// frame.jpg, map_x.f32, map_y.f32, list.f32 (millimetres of 0 … 255 levels).
void export_inputs(const std::string& folder);

/// Millimetres of a darkening of 0 … 255 whole grey levels: the model's LUT for other pipelines.
[[nodiscard]] std::vector<float> lut_mm_of();

}  // namespace dtact::bench
