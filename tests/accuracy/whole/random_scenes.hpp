#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/whole/scene_judge.hpp"

namespace dtact::whole {

struct RandomRun {
  std::uint64_t seed = 43;
  int sensors = 10;
  int scenes_each = 20;
  int threads = 2;
  std::string only;              ///< The name of the one scene to judge; empty: all.
  std::filesystem::path folder;  ///< Folder of calibrations; an existing one is used.
};

/// Draws sensors, calibrates each, and judges scenes on it. The output of a sensor's calibration is
/// beside its folder. Prints a line for each scene.
[[nodiscard]] std::vector<SceneReport> run(const RandomRun& wanted);

}  // namespace dtact::whole
