#pragma once

#include <string>

#include "daemon/recon/model.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// Reads [lut] and [uncertainty], and [scattering] and [[sharpened]], which calibrations of the
/// old kind have not. The model's method is known already. Throws std::runtime_error with file,
/// line, key and fix.
void read_luts(tomlfile::KeyReader& top, recon::Model& model);

/// What read_luts() reads back. Ends in an array of tables: nothing but tables can follow.
[[nodiscard]] std::string format_luts(const recon::Model& model);

}  // namespace dtact::calibration
