#pragma once

#include <CLI/CLI.hpp>
#include <iosfwd>
#include <string>
#include <vector>

#include "clients/cpp/client.hpp"

namespace dtact::cli {

/// What all commands of a program share. FilledBuffer while the command line is parsed.
struct Context {
  client::Options target;
  bool json = false;
  std::ostream& out;
};

/// Adds the options for the daemon's address, token and certificate, and --version, before and
/// after the command. A command is required. Lists the exit codes below the help. The daemon sees
/// the program's name and version.
void add_global_options(CLI::App& app, Context& context);

/// The options that were given to a command, those of its parents left out, as words of a command
/// line.
[[nodiscard]] std::vector<std::string> given_options(const CLI::App& app);

/// As CLI::Range and CLI::PositiveNumber, which let NaN pass: refuses all that is no number in the
/// range, and for positive() what is above 1e9.
[[nodiscard]] CLI::Validator in_range(double least, double most);
[[nodiscard]] CLI::Validator positive();

/// --json, of a command that prints what it was asked for.
CLI::Option* add_json_option(CLI::App& command, Context& context);

/// The command line that `command` was parsed from, for a shell: the program, its options, the
/// command and its options, each with its value.
[[nodiscard]] std::string command_line(const CLI::App& command);

/// Parses `arguments` (without the program's own name), which runs the command. Help goes to `out`,
/// what went wrong as a sentence to `error`. Returns an ExitCode.
[[nodiscard]] int run(CLI::App& app, std::vector<std::string> arguments, std::ostream& out,
                      std::ostream& error);

}  // namespace dtact::cli
