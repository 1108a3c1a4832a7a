#pragma once

#include <string>

#include "daemon/pipeline/port.hpp"

namespace dtact::net {

/// What the user should do about the state and the health conditions: a sentence for each, with
/// its remedy, the most urgent first. Empty when all is well.
[[nodiscard]] std::string advice(const pipeline::Status& status);

}  // namespace dtact::net
