#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>
#include <string>
#include <vector>

#include "clients/common/program.hpp"

namespace dtact::dds {

/// Gives `app` dtact-dds's name and options; what parses later fills `context`, which must outlive
/// that.
void set_up(CLI::App& app, cli::Context& context);

/// The program dtact-dds, for main() and tests. Returns an ExitCode.
[[nodiscard]] int run(const std::vector<std::string>& arguments, std::ostream& out,
                      std::ostream& error);

}  // namespace dtact::dds
