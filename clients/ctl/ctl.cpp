#include "clients/ctl/ctl.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>

#include "clients/calibrate/offline/offline.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/cpp/errors.hpp"
#include "clients/ctl/cameras.hpp"
#include "clients/ctl/online.hpp"
#include "version.hpp"

namespace dtact::ctl {
namespace {

int parse(CLI::App& app, std::vector<std::string> arguments, std::ostream& out,
          std::ostream& error) {
  try {
    // CLI11 takes them from the back.
    std::reverse(arguments.begin(), arguments.end());
    app.parse(std::move(arguments));
    out.flush();
    return kOk;
  } catch (const CLI::ParseError& e) {
    // Also --help and --version, with exit code 0.
    return app.exit(e, out, error) == 0 ? kOk : kUsage;
  }
}

}  // namespace

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app("Talks to dtactd, the daemon for DTact tactile sensors, and works on its files.",
               "dtactctl");
  app.set_version_flag("--version", "dtactctl " DTACT_VERSION);
  app.footer(kExitCodesHelp);
  app.require_subcommand(1);
  app.fallthrough();  // global options may stand behind the command

  Context context{{}, false, out};
  context.target.program = "dtactctl " DTACT_VERSION;
  app.add_option("--host", context.target.host, "Name or address of the daemon's machine")
      ->capture_default_str();
  app.add_option("--port", context.target.port, "TCP port of the daemon")
      ->capture_default_str()
      ->check(CLI::Range(1, 65535));
  app.add_flag("--json", context.json, "Print JSON, one object a line");
  add_status(app, context);
  add_watch(app, context);
  add_led(app, context);
  add_rezero(app, context);
  add_calibration(app, context);
  add_snapshot(app, context);
  add_cameras(app, context);
  add_offline_commands(app, context.json);
  add_guided_calibration(app, context);

  const auto fail = [&](const std::exception& e, ExitCode code) {
    out.flush();
    error << "dtactctl: " << e.what() << '\n';
    return code;
  };
  try {
    return parse(app, arguments, out, error);
  } catch (const Failure& e) {
    return fail(e, e.code());
  } catch (const client::ConnectionError& e) {
    return fail(e, kNoConnection);
  } catch (const std::exception& e) {
    return fail(e, kFailed);
  }
}

}  // namespace dtact::ctl
