#pragma once

#include <string>

#include "daemon/recon/spatial_gain.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// A `[gain]` table of a calibration (places from the map's centre) or a lens file (places of the
/// lens's millimetres).
[[nodiscard]] std::string format_gain(const recon::SpatialGain& gain);

/// Takes a `[gain]` table's keys; an empty table is no gain, as in files from before there were
/// gains. Throws as KeyReader.
[[nodiscard]] recon::SpatialGain read_gain(tomlfile::KeyReader reader);

}  // namespace dtact::calibration
