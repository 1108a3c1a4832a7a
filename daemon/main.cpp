#include <spdlog/spdlog.h>

#include <exception>
#include <iostream>
#include <string>

#include "daemon/app/config.hpp"
#include "daemon/app/daemon.hpp"
#include "daemon/app/doctor/doctor.hpp"
#include "daemon/app/files.hpp"
#include "daemon/app/journal.hpp"
#include "daemon/app/options.hpp"
#include "daemon/app/service.hpp"

int main(int argc, char** argv) {
  using namespace dtact::app;
  std::string fix;         // what to try beside what an error says
  bool is_service = true;  // systemd hears of its main process alone, not of its reload's check
  try {
    spdlog::set_default_logger(make_logger());
    const Parsed command_line = parse_options(argc, argv);
    if (command_line.exit_status) return *command_line.exit_status;
    const Options& options = command_line.options;

    is_service = !options.check_config;
    if (is_service) {
      fix = "; once it is fixed, check it: " + command_with(options, "--check-config");
    }
    const LoadedConfig loaded = load_config(options.config, options.settings);
    if (options.print_config) print_config(loaded, std::cout);
    if (options.check_config) {
      check_net_files(loaded.config.net);
      if (!has_uploaded_calibration(loaded.config)) check_calibration(loaded.config);
      check_devices(loaded.config.hal);
    }
    if (options.print_config || options.check_config) return 0;
    if (options.report) {
      report(loaded.config.hal, std::cout);
      return 0;
    }
    if (options.doctor) return doctor(loaded.config.hal, std::cout);

    spdlog::set_level(spdlog::level::from_str(loaded.config.log_level));
    fix = "; what else this machine lacks: " + command_with(options, "--doctor");
    run_daemon(loaded.config,
               [&options] { return load_config(options.config, options.settings).config; });
    return 0;
  } catch (const std::exception& e) {
    spdlog::critical("{}{}", e.what(), fix);
    if (is_service) notify_status(e.what() + fix);
    return 1;
  }
}
