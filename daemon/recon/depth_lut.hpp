#pragma once

#include <cstdint>
#include <vector>

namespace dtact::recon {

/// Entries of a LUT for one grey level.
inline constexpr int kEntriesPerLevel = 64;

/// Darkening → indentation, 64 entries a grey level, so that a look-up needs no interpolation (the
/// kernels may use straight lines that follow the entries: kernel_lut.hpp).
/// Entry i belongs to the Q6 darkening first_q6 + i. Below first_q6 the first entry holds (a bulge
/// brighter than the LUT covers is still a bulge). Above covered_to_q6 the method `lut` marks
/// pixels untrusted (pressed deeper than calibrated); `published` keeps the end value.
struct DepthLut {
  int first_q6 = 0;              ///< Darkening of entry 0, Q6 grey levels (64 = one level).
  std::vector<std::int16_t> um;  ///< Indentation in micrometres, positive = pressed.
  int covered_from_q6 = 0;       ///< Smallest darkening the calibration saw.
  int covered_to_q6 = 0;         ///< Greatest darkening the calibration vouches for.
};

/// Throws std::invalid_argument, naming the key as in calibration.toml, unless the LUT lies within
/// ±255 grey levels, covers a range inside itself, holds nothing beyond ±16.383 mm and, where
/// `monotone` asks for it, never falls (the published LUT is a plain mean and may).
void check(const DepthLut& lut, bool monotone);

}  // namespace dtact::recon
