#pragma once

#include <string>

#include "daemon/recon/force.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// A calibration's `[force]` table, which those without a force do not have.
[[nodiscard]] std::string format_force(const recon::ForceModel& force);
/// Takes its keys. Throws as KeyReader.
[[nodiscard]] recon::ForceModel read_force(tomlfile::KeyReader reader);

}  // namespace dtact::calibration
