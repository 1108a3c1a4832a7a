#include "clients/calibrate/calibrate.hpp"

#include "clients/calibrate/guided_command.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/calibrate/reprocess/reprocess.hpp"
#include "clients/common/program.hpp"

namespace dtact::calibrate {

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app(
      "Makes calibrations for dtactd, the daemon for DTact tactile sensors, and judges them.",
      "dtact-calibrate");
  cli::Context context{{}, false, out};
  cli::add_global_options(app, context);
  ctl::add_guided(app, context);
  ctl::add_offline_commands(app, context.json);
  reprocess::add_reprocess(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::calibrate
