#pragma once

#include <filesystem>

#include "hal/sim/scene.hpp"

namespace dtact::hal::sim {

/// Gives `scene` the gel and the light of a sensor that was calibrated by a model: what the
/// tables [gel] and [scattering] of calibration.toml in `folder` say. Throws std::runtime_error
/// naming file, key and what is allowed, and where the calibration has no such tables.
void take_from_calibration(const std::filesystem::path& folder, Scene& scene);

}  // namespace dtact::hal::sim
