#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/table/judge.hpp"
#include "tests/accuracy/table/trial.hpp"

namespace dtact::table {

/// Law of gel and light: the built-in sensor's, or another_law()'s.
enum class Law : std::uint8_t { built_in, another };

/// One method under one configuration over the test presses of one trial.
struct Cell {
  std::uint64_t seed = 0;
  std::size_t configuration = 0;  ///< Into configurations().
  std::size_t method = 0;         ///< Into methods().
  Law law = Law::built_in;
  Error circle;       ///< Against the published circle's sphere.
  Error indentation;  ///< Against the simulator's truth, in contact.
};

/// Solves a trial's presses once and judges every method under the configurations
/// [0, `configuration_count`); in a trial without `many` only the methods of one press.
[[nodiscard]] std::vector<Cell> run_trial(const Trial& trial, std::size_t configuration_count,
                                          Law law = Law::built_in);

/// All cells, one line each.
[[nodiscard]] std::string to_csv(const std::vector<Cell>& cells);
/// Means over the seeds, with the paper's rows beside them.
[[nodiscard]] std::string to_markdown(const std::vector<Cell>& cells);

}  // namespace dtact::table
