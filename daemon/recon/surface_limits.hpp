#pragma once

namespace dtact::recon {

/// What a Surface may be, in a calibration and on the wire.
struct SurfaceLimits {
  static constexpr double kLeastRadiusMm = 1;
  static constexpr double kMostRadiusMm = 10000;
  static constexpr double kLeastDistanceMm = 0.01;  ///< Of air and of gel on the camera's axis.
  static constexpr double kMostDistanceMm = 1000;
  static constexpr double kMostRefraction = 3;  ///< From 1.
  // Of heights.
  static constexpr int kLeastNodes = 4;  ///< Along each side.
  static constexpr int kMostNodes = 64;
  static constexpr double kLeastSpacingMm = 0.05;
  static constexpr double kMostSpacingMm = 20;
  static constexpr double kMostHeightMm = 100;  ///< To both sides of 0.
  /// From a node to its neighbour, 72°: a camera that looks along z hardly sees what is steeper.
  static constexpr double kMostSlope = 3;
};

}  // namespace dtact::recon
