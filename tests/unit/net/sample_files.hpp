#pragma once

#include <string>

#include "daemon/calibration/text.hpp"
#include "daemon/net/calibration_store.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::net {

/// The files of a complete calibration with this name, as a client uploads it.
inline CalibrationFiles whole(const std::string& name) {
  const calibration::Files files = calibration::format(calibration::sample());
  return {name, files.toml, files.reference_png};
}

}  // namespace dtact::net
