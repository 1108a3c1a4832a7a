#pragma once

#include <string>

#include "daemon/pipeline/port.hpp"

namespace dtact::net {

/// What a health flag of `status` means, and its fix.
[[nodiscard]] std::string fix(const pipeline::Status& status, pipeline::Health health);
/// What the user should do about the state and the health flags: a sentence for each, with
/// its fix, the most urgent first. Empty when all is well.
[[nodiscard]] std::string advice(const pipeline::Status& status);

/// The name on the wire, which clients show: "camera_fault", "serving".
[[nodiscard]] std::string health_name(pipeline::Health health);
[[nodiscard]] std::string state_name(pipeline::State state);

}  // namespace dtact::net
