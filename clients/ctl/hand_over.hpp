#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace dtact::ctl {

/// Adds the commands that dtact-calibrate runs: they put that program in dtactctl's place.
/// `arguments`: dtactctl's own, which the commands hand over when they run.
void add_handed_over(CLI::App& app, const std::vector<std::string>& arguments);

/// What dtact-calibrate gets for dtactctl's `arguments`: `calibrate depth` and `calibrate lens`
/// without the first word, `calibrate` alone as `guided`, all else as it is.
[[nodiscard]] std::vector<std::string> for_calibrate(std::vector<std::string> arguments);

}  // namespace dtact::ctl
