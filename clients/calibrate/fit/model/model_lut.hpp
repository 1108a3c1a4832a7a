#pragma once

#include <array>
#include <vector>

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "daemon/recon/depth_lut.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// How the map that a LUT is asked about is made of the camera's image.
struct MapOptics {
  double light_levels = 0;  ///< Grey level that counts as all of the light.
  double smoothing_mm = 0;
  double mm_per_px = 0;
};

/// A LUT and what it is uncertain by.
struct ModelLut {
  recon::DepthLut lut;
  std::vector<recon::Model::Uncertainty> uncertainty;
};

/// One for each number of steps of the filter that takes the scattering back, none first
/// (sharpened()).
inline constexpr int kLuts = recon::kMaxSharpeningSteps + 1;

/// The mean indentation over balls of 1.5 to 8 mm radius, pressed to all depths up to `deepest_mm`
/// into the gel, of what the map shows of them. Inverting the response alone would be biased,
/// since what a place shows depends on what lies beside it. Nothing shown is no indentation; the
/// LUT rises throughout. It covers what the balls show and two grey levels beyond the deepest.
[[nodiscard]] std::array<recon::DepthLut, kLuts> luts_of(const GelModel& gel,
                                                         const MapOptics& optics,
                                                         double deepest_mm);

/// Those LUTs with their root mean square errors, by depth, over balls on gels drawn from the
/// fit's covariance and seen with one frame's noise.
[[nodiscard]] std::array<ModelLut, kLuts> luts_of(const ModelFit& fit, const MapOptics& optics);

}  // namespace dtact::calibration
