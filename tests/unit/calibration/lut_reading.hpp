#pragma once

#include <cmath>
#include <cstddef>

#include "daemon/recon/depth_lut.hpp"

namespace dtact::calibration {

/// What the LUT reads at a darkening of `level` grey levels, micrometres.
inline double um_at(const recon::DepthLut& lut, double level) {
  return lut.um[static_cast<std::size_t>(std::lround(level * 64) - lut.first_q6)];
}

}  // namespace dtact::calibration
