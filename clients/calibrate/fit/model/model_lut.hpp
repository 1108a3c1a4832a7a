#pragma once

#include <array>
#include <vector>

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "daemon/recon/depth_lut.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// How the map that a LUT reads is made from the camera's image.
struct MapOptics {
  double light_levels = 0;  ///< Grey level of full light.
  double smoothing_mm = 0;
  double mm_per_px = 0;
};

/// A LUT and its uncertainty.
struct ModelLut {
  recon::DepthLut lut;
  std::vector<recon::Model::Uncertainty> uncertainty;
};

/// Number of LUTs: one for each number of steps of the sharpening filter, none first
/// (sharpened()).
inline constexpr int kLuts = recon::kMaxSharpeningSteps + 1;

/// LUTs from the map's pictures of balls of 1.5 to 8 mm radius, pressed to all depths up to
/// `deepest_mm` into the gel: the mean indentation at each level. Inverting the response only would
/// be biased, since each point depends on its surroundings. No darkening is no indentation; the LUT
/// rises throughout. It covers the balls' levels and two grey levels beyond the deepest.
[[nodiscard]] std::array<recon::DepthLut, kLuts> luts_of(const GelModel& gel,
                                                         const MapOptics& optics,
                                                         double deepest_mm);

/// Those LUTs with their root mean square errors, by depth, over balls on gels drawn from the
/// fit's covariance and seen with one frame's noise.
[[nodiscard]] std::array<ModelLut, kLuts> luts_of(const ModelFit& fit, const MapOptics& optics);

}  // namespace dtact::calibration
