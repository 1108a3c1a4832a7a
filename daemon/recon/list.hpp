#pragma once

#include <cstdint>
#include <vector>

namespace dtact::recon {

/// Darkening → indentation, 64 entries a grey level, so that a look-up needs no interpolation.
/// Entry i belongs to the Q6 darkening first_q6 + i. Outside its covered range the list holds its
/// end value and the pixel is untrusted on the deep side (beyond what was calibrated).
struct DepthList {
  int first_q6 = 0;              ///< Darkening of entry 0, Q6 grey levels (64 = one level).
  std::vector<std::int16_t> um;  ///< Indentation in micrometres, positive = pressed.
  int covered_from_q6 = 0;       ///< Smallest darkening the calibration saw.
  int covered_to_q6 = 0;         ///< Greatest darkening the calibration saw.
};

}  // namespace dtact::recon
