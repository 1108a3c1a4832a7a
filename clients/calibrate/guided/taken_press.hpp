#pragma once

#include <string>

namespace dtact::ctl::guided {

/// A press that was taken, on the depth map.
struct TakenPress {
  std::string name;
  double col = 0;  ///< Of the contact's middle, pixels.
  double row = 0;
  double radius_px = 0;
  double depth_mm = 0;  ///< Of its lowest point: as fitted, else by the contact's width.
};

}  // namespace dtact::ctl::guided
