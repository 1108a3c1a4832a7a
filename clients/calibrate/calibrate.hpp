#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>
#include <string>
#include <vector>

#include "clients/common/program.hpp"

namespace dtact::calibrate {

/// Gives `app` dtact-calibrate's name, options and commands. Parsing later fills `context`,
/// which must outlive it.
void set_up(CLI::App& app, cli::Context& context);

/// The program dtact-calibrate, for main() and tests: runs the command that `arguments` (without
/// the program's own name) asks for. Returns an ExitCode.
[[nodiscard]] int run(const std::vector<std::string>& arguments, std::ostream& out,
                      std::ostream& error);

}  // namespace dtact::calibrate
