#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "daemon/calibration/calibration.hpp"

namespace dtact::atlas {

/// A method calibrated on the clean simulated sensor, by the table's protocol.
struct Method {
  std::string_view name;
  std::shared_ptr<const calibration::Calibration> calibration;
  int sharpen_steps = 0;
};

/// The table's methods, each calibrated once.
[[nodiscard]] const std::vector<Method>& methods();
/// "sphere alone, one press" as methods() has it, without calibrating the others.
[[nodiscard]] const Method& alone_single();

}  // namespace dtact::atlas
