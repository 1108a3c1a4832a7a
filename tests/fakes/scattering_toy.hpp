#pragma once

#include <memory>
#include <utility>

#include "tests/fakes/toy_sensor.hpp"

namespace dtact::fakes {

/// The toy sensor with a gel that scatters. Its LUTs are the same for sharpened levels, with an
/// uncertainty of `sharpened_um`.
inline std::shared_ptr<calibration::Calibration> scattering_toy_calibration(double sharpened_um) {
  auto calibration = toy_calibration();
  recon::Model model = *calibration->model;
  model.scattering = recon::Scattering{.narrow_mm = 0.8, .wide_mm = 2.4, .narrow_weight = 0.7};
  for (const int steps : {1, 2}) {
    model.sharpened.push_back({.steps = steps,
                               .lut = model.lut,
                               .uncertainty = {{.depth_mm = 0.5, .error_um = sharpened_um}}});
  }
  calibration->model = std::make_shared<const recon::Model>(std::move(model));
  return calibration;
}

}  // namespace dtact::fakes
