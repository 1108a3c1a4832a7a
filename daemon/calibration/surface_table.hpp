#pragma once

#include <string>

#include "daemon/recon/surface.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// A `[surface]` table of a calibration; empty for a plane.
[[nodiscard]] std::string format_surface(const recon::Surface& surface);

/// Takes a `[surface]` table's keys. Throws as KeyReader.
[[nodiscard]] recon::Surface read_surface(tomlfile::KeyReader reader);

}  // namespace dtact::calibration
