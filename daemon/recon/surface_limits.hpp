#pragma once

namespace dtact::recon {

/// What a Surface may be, in a calibration and on the wire.
struct SurfaceLimits {
  static constexpr double kLeastRadiusMm = 1;
  static constexpr double kMostRadiusMm = 10000;
  static constexpr double kLeastDistanceMm = 0.01;  ///< Of air and of gel on the camera's axis.
  static constexpr double kMostDistanceMm = 1000;
  static constexpr double kMostRefraction = 3;  ///< From 1.
};

}  // namespace dtact::recon
