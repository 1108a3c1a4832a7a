#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace dtact::app {

/// The command line of dtactd.
struct Options {
  std::optional<std::filesystem::path> config;  ///< --config; none = built-in defaults.
  std::vector<std::string> settings;            ///< --set KEY=VALUE, in order.
  bool check_config = false;
  bool print_config = false;
  bool doctor = false;  ///< --doctor: check the machine instead of running.
  bool report = false;  ///< --report: the same for other readers
};

/// What does something else with the same configuration: "dtactd --config FILE --doctor".
[[nodiscard]] std::string command_with(const Options& options, const std::string& option);

/// Either options to run with, or the exit status after --help, --version or a mistake, whose text
/// has been printed.
struct Parsed {
  Options options;
  std::optional<int> exit_status;
};

/// Gives `cli` dtactd's name and options, which fill `options` when they are parsed.
void set_up(CLI::App& cli, Options& options);

[[nodiscard]] Parsed parse_options(int argc, const char* const* argv);

}  // namespace dtact::app
