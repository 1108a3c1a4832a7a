#pragma once

#include <string>

#include "daemon/calibration/calibration.hpp"

namespace dtact::calibration {

/// Limit for a side of any image; keeps every index within int.
inline constexpr int kMaxPixels = 16384;
/// Version of the files. Another one is refused, whatever its keys.
inline constexpr int kFormatVersion = 1;
inline constexpr const char* kTomlName = "calibration.toml";
inline constexpr const char* kReferenceName = "reference.png";

/// The two files of a calibration folder.
struct Files {
  std::string toml;
  std::string reference_png;  ///< 16-bit grey, Q8 luma: a value is the grey level times 256.
};

/// What parse() reads back. Throws std::invalid_argument when the calibration's parts disagree or
/// its rectification is not what its crop and lens say.
[[nodiscard]] Files format(const Calibration& calibration);

}  // namespace dtact::calibration
