#pragma once

#include <vector>

#include "clients/calibrate/guided/cells.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl::guided {

/// Frames of a surface that held still.
struct Still {
  std::vector<image::Grey8> frames;
  CellMeans cells;          ///< Mean of all.
  double drift_levels = 0;  ///< The largest change of a cell from the first half to the last.
  double noise_levels = 0;  ///< Standard deviation of a pixel from frame to frame.
};

}  // namespace dtact::ctl::guided
