#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/cpp/client.hpp"

namespace dtact::ctl {

/// "ball, method lut, 580x580 of 800x600 at 0.0414 mm/px, covers -0.02 to 1.40 mm, 2026-…"
[[nodiscard]] std::string text_of(const v1::CalibrationSummary& summary);

/// What a calibration goes by on the command line: "17", or "configured".
[[nodiscard]] std::string id_of(std::uint64_t number);
/// The reverse. Throws std::invalid_argument saying what is allowed.
[[nodiscard]] std::uint64_t parse_id(const std::string& text);

/// A table with a line for each; those that cannot be read with the reason. `*` stands before the
/// one in use, `>` before the one to start with where that is another one.
[[nodiscard]] std::string text_of(const std::vector<v1::StoredCalibration>& calibrations);

}  // namespace dtact::ctl
