#pragma once

#include <cmath>
#include <cstddef>

#include "daemon/recon/list.hpp"

namespace dtact::calibration {

/// What the list reads at a darkening of so many grey levels, micrometres.
inline double um_at(const recon::DepthList& list, double level) {
  return list.um[static_cast<std::size_t>(std::lround(level * 64) - list.first_q6)];
}

}  // namespace dtact::calibration
