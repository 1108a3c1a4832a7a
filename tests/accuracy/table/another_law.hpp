#pragma once

#include "hal/sim/scene.hpp"

namespace dtact::table {

/// The sensor of another_law.toml with the built-in camera and light, no contact: for one row
/// of every table. Throws std::runtime_error when the file cannot be read.
[[nodiscard]] hal::sim::Scene another_law();

}  // namespace dtact::table
