#pragma once

#include <array>
#include <vector>

#include "clients/calibrate/fit/model/model_fit.hpp"
#include "daemon/recon/list.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// How the map that a list is asked about is made of the camera's image.
struct MapOptics {
  double light_levels = 0;  ///< Grey level that counts as all of the light.
  double smoothing_mm = 0;
  double mm_per_px = 0;
};

/// A list and what it is uncertain by.
struct ListOfModel {
  recon::DepthList list;
  std::vector<recon::Model::Uncertainty> uncertainty;
};

/// One for each number of steps of the filter that takes the scattering back, none first
/// (sharpened()).
inline constexpr int kLists = recon::kMostSharpeningSteps + 1;

/// The mean indentation over balls of 1.5 to 8 mm radius, pressed to all depths up to `deepest_mm`
/// into the layer, of what the map shows of them. Inverting the response alone would be biased,
/// since what a place shows depends on what lies beside it. Nothing shown is no indentation; the
/// list rises throughout. It covers what the balls show and two grey levels beyond the deepest.
[[nodiscard]] std::array<recon::DepthList, kLists> lists_of(const LayerModel& layer,
                                                            const MapOptics& optics,
                                                            double deepest_mm);

/// Those lists with their root mean square errors, by depth, over balls on layers drawn from the
/// fit's covariance and seen with one frame's noise.
[[nodiscard]] std::array<ListOfModel, kLists> lists_of(const ModelFit& fit,
                                                       const MapOptics& optics);

}  // namespace dtact::calibration
