#pragma once

#include <array>

#include "clients/geometry/point_cloud.hpp"

namespace dtact::perceive {

/// Input of the recognition: depth around the contact on cells of one size for all sensors.
struct TouchMap {
  static constexpr int kSide = 96;         ///< Cells along each side.
  static constexpr double kCellMm = 0.25;  ///< So that the map is 24 mm wide.
  /// Row-major, millimetres, positive = pressed, limited to kMinMm … kMaxMm. 0 beyond the depth
  /// map and where it is untrusted. The contact's centre is in the middle.
  std::array<float, std::size_t{kSide} * kSide> mm{};
  double deepest_mm = 0;
  double area_mm2 = 0;  ///< Pressed deeper than the contact threshold.
  /// Length of the depth map's border that is in contact, as a share of the square root of the
  /// area: 0 for a whole contact, 1.6 for a disc of which half is seen.
  double cut = 0;
  static constexpr double kMinDeepestMm = 0.3;  ///< Shallower presses look alike.
  static constexpr double kMaxCut = 1;  ///< A contact with a larger `cut` may be of anything.
  static constexpr float kMinMm = -1;
  static constexpr float kMaxMm = 3;
};

/// From a whole depth map with pixels of at most kCellMm.
[[nodiscard]] TouchMap touch_map(const DepthGrid& depth);

}  // namespace dtact::perceive
