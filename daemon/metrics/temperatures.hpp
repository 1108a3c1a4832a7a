#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dtact::metrics {

/// One of the board's own thermometers.
struct Temperature {
  std::string zone;  ///< "thermal_zone0"
  std::string type;  ///< "cpu-thermal", as the kernel's driver calls it
  double celsius = 0;
};

/// What the kernel's thermal zones read now, in the order of their names; those that do not answer
/// are left out. `folder`: as in the kernel's Documentation/ABI/testing/sysfs-class-thermal.
[[nodiscard]] std::vector<Temperature> temperatures(
    const std::filesystem::path& folder = "/sys/class/thermal");

}  // namespace dtact::metrics
