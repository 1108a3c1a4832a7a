#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/trial.hpp"

namespace dtact::table {

/// One method under one configuration over the test presses of one trial.
struct Cell {
  std::uint64_t seed = 0;
  std::size_t configuration = 0;  ///< Into configurations().
  std::size_t method = 0;         ///< Into methods().
  Error circle;                   ///< Against the published circle's sphere.
  Error indentation;              ///< Against the simulator's truth, where the ball touches.
};

/// Solves a trial's presses once and judges every method under the configurations
/// [0, `configuration_count`).
[[nodiscard]] std::vector<Cell> run_trial(const Trial& trial, std::size_t configuration_count);

/// All cells, one line each.
[[nodiscard]] std::string to_csv(const std::vector<Cell>& cells);
/// Means over the seeds, with the paper's rows beside them.
[[nodiscard]] std::string to_markdown(const std::vector<Cell>& cells);

}  // namespace dtact::table
