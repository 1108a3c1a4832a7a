#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>
#include <string>
#include <vector>

#include "clients/common/program.hpp"

namespace dtact::web {

/// Gives `app` dtact-web's name, options and commands; what parses later fills `context`, which
/// must outlive that.
void set_up(CLI::App& app, cli::Context& context);

/// The program dtact-web, for main() and tests: runs the command that `arguments` (without the
/// program's own name) asks for. Returns an ExitCode.
[[nodiscard]] int run(const std::vector<std::string>& arguments, std::ostream& out,
                      std::ostream& error);

}  // namespace dtact::web
