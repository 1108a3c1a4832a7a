#pragma once

#include <opencv2/core.hpp>

#include "hal/sim/grid.hpp"

namespace dtact::hal::sim {

/// The indentation after an object that sticks to the gel has dragged it along by (x_mm, y_mm).
/// Where they touch the map follows the object. Around it the gel is sheared and comes after: there
/// the map is that of the object where it was, drawn towards where it is. The shear fades out over
/// about the gel's thickness. `touching`: > 0 where they touch. All are grid sized.
[[nodiscard]] cv::Mat1d dragged(const cv::Mat1d& indentation_mm, const cv::Mat1d& touching,
                                double x_mm, double y_mm, double thickness_mm, const Grid& grid);

}  // namespace dtact::hal::sim
