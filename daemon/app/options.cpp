#include "daemon/app/options.hpp"

#include "version.hpp"

namespace dtact::app {

void set_up(CLI::App& cli, Options& options) {
  cli.name("dtactd")->description(
      "Reads a DTact sensor, reconstructs depth and streams it over TCP.\n"
      "Every key of the configuration is documented in dtactd.toml.");
  cli.set_version_flag("--version", "dtactd " DTACT_VERSION);
  cli.add_option("-c,--config", options.config, "Configuration file (TOML)")
      ->check(CLI::ExistingFile);
  cli.add_option("--set", options.settings,
                 "Set one key, as in --set camera.fps=30; wins over the file, may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  cli.add_option_function<std::string>(
         "--log-level",
         [&options](const std::string& level) {
           options.settings.push_back("log_level='" + level + "'");
         },
         "The same as --set log_level=LEVEL: trace, debug, info, warn or error")
      ->type_name("LEVEL");
  cli.add_flag("--check-config", options.check_config,
               "Check the configuration, and the files it names, say what is wrong, and exit");
  cli.add_flag("--print-config", options.print_config,
               "Print the effective values and where each came from, and exit");
  CLI::Option* const doctor = cli.add_flag(
      "--doctor", options.doctor,
      "Check what the configuration needs of this machine, print what is wrong with the\n"
      "command that fixes it, and exit; status 1 when something is wrong");
  cli.add_flag("--report", options.report,
               "With --doctor: what this machine is and what is wrong, to be sent to others;\n"
               "no names of users and hosts and no serial numbers")
      ->needs(doctor);
  cli.footer(
      "Environment: DTACTD_LOG sets the log level; it wins over the file, an option over it.\n"
      "DTACTD_NAME names the sensor where net.name does not, in place of the machine.\n"
      "Signals: SIGHUP reads the configuration again and takes what can change while it runs:\n"
      "the log level, limits of clients, certificate, key and tokens. A client whose token is "
      "gone\n"
      "is disconnected. New credentials need a restart. A file with a mistake changes nothing.\n"
      "SIGTERM and SIGINT end it.\n"
      "Log: one line for each command that changes something, with the client's address and\n"
      "program, the name of its token, the values and the result. In the journal DTACT_CLIENT and\n"
      "DTACT_TOKEN find them: journalctl -u dtactd DTACT_TOKEN=NAME.\n"
      "Limits: no client ends the daemon, fills its memory or locks others out. proto/README.md "
      "has\n"
      "the limits of clients, requests, messages and files, dtactd.toml(5) those that may be set.\n"
      "Exit status: 0 after SIGTERM or SIGINT, 1 on an error, 2 on a wrong command line.");
}

Parsed parse_options(int argc, const char* const* argv) {
  Parsed parsed;
  CLI::App cli;
  set_up(cli, parsed.options);
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    parsed.exit_status = cli.exit(e) == 0 ? 0 : 2;
  }
  return parsed;
}

std::string command_with(const Options& options, const std::string& option) {
  const std::string config = options.config ? " --config " + options.config->string() : "";
  return "dtactd" + config + " " + option;
}

}  // namespace dtact::app
