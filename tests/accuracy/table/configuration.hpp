#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "hal/light_ring.hpp"
#include "hal/sim/scene.hpp"

namespace dtact::table {

/// The depth map's part of the frame in the paper: 580×580 of 800×600 pixels for 24×24 mm².
inline constexpr int kFrameWidth = 800;
inline constexpr int kFrameHeight = 600;
inline constexpr int kCrop = 580;
inline constexpr int kCropCol = (kFrameWidth - kCrop) / 2;
inline constexpr int kCropRow = (kFrameHeight - kCrop) / 2;
inline constexpr double kMmPerPx = 24.0 / kCrop;
/// The simulated camera's place, as its drawing would say it; unknown where rays are parallel.
[[nodiscard]] calibration::CameraView view_of(const hal::sim::Scene& scene);

/// The paper's figures for a column of its table "MAE on testing images", millimetres; the
/// standard deviation of the reference image in grey levels.
struct Published {
  double deviation = 0;
  double single_mm = 0;
  double regression_mm = 0;
};

/// (u_c, v_c) of the paper's linear regression, from the crop's centre.
struct RegressionCentre {
  double right_mm = 0;
  double down_mm = 0;
};

/// A column of the table: which LEDs are lit, and where they are.
struct Configuration {
  std::string_view name;
  std::string_view scheme;  ///< A name of net::scheme_leds().
  hal::sim::Arrangement arrangement = hal::sim::Arrangement::ring;
  /// Exposure relative to all LEDs of the ring: half of the LEDs are exposed twice as long, so that
  /// the reference image is as bright.
  double exposure = 1;
  /// The paper moved it to the upper right corner for scheme 4.
  RegressionCentre regression_centre;
  std::optional<Published> published;  ///< The paper shows the side-lit sensor without numbers.
};

/// The paper's five, then the side-lit one.
[[nodiscard]] std::span<const Configuration> configurations();

/// `base` under the configuration's light.
[[nodiscard]] hal::sim::Scene lit(hal::sim::Scene base, const Configuration& configuration);
[[nodiscard]] hal::Light light_of(const Configuration& configuration);

/// Standard deviation of the reference image without noise over the crop, grey levels.
[[nodiscard]] double reference_deviation(const Configuration& configuration);

}  // namespace dtact::table
