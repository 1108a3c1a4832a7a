#pragma once

#include <filesystem>

#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Gives `scene` the gel and the light of a sensor that was calibrated by a model: the contents of
/// tables [gel] and [scattering] of calibration.toml in `folder`. Throws std::runtime_error
/// naming file, key and what is allowed, also when the calibration lacks these tables.
void take_from_calibration(const std::filesystem::path& folder, Scene& scene);

}  // namespace dtact::hal::sim
