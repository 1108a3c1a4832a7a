#pragma once

#include <string>

#include "daemon/calibration/layer.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// The `[layer]` table.
[[nodiscard]] std::string format_layer(const Layer& layer);
/// Throws as KeyReader.
[[nodiscard]] Layer read_layer(tomlfile::KeyReader reader);

}  // namespace dtact::calibration
