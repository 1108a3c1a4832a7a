#pragma once

#include "hal/sim/scene.hpp"
#include "tests/accuracy/sim/ball_profile.hpp"

namespace dtact::accuracy {

inline constexpr double kBallRadius_mm = 4.0;

/// A scene fitted to one real press, and where its ball is.
struct Fit {
  hal::sim::Scene scene;
  double x_mm = 0;  ///< Measured: the centroid of the darkening.
  double y_mm = 0;
  double depth_mm = 0;
  double rms = 0;  ///< RMS of the profiles' difference, grey levels.
};

/// Fits twelve parameters: depth, thickness, four of the response and three of the scattering to
/// the radial profile; level and vignetting to the reference image; read noise to its high-pass
/// noise.
[[nodiscard]] Fit fit_sensor(const Sensor& sensor, const BallPress& real);

}  // namespace dtact::accuracy
