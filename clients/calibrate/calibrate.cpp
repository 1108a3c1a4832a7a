#include "clients/calibrate/calibrate.hpp"

#include "clients/calibrate/force/force_command.hpp"
#include "clients/calibrate/guided_command.hpp"
#include "clients/calibrate/objects/objects_command.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "clients/calibrate/reprocess/reprocess.hpp"

namespace dtact::calibrate {

void set_up(CLI::App& app, cli::Context& context) {
  app.name("dtact-calibrate")
      ->description(
          "Makes calibrations for dtactd, the daemon for DTact tactile sensors, and judges them.");
  cli::add_global_options(app, context);
  ctl::add_guided(app, context);
  ctl::add_offline_commands(app, context.json);
  cli::add_json_option(*app.get_subcommand("evaluate"), context);
  force::add_force(app, context);
  reprocess::add_reprocess(app, context);
  objects::add_objects(app, context);
}

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app;
  cli::Context context{{}, false, out};
  set_up(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::calibrate
