#include "clients/ctl/ctl.hpp"

#include "clients/ctl/cameras.hpp"
#include "clients/ctl/export.hpp"
#include "clients/ctl/online.hpp"
#include "clients/ctl/secrets.hpp"

namespace dtact::ctl {

void set_up(CLI::App& app, cli::Context& context) {
  app.name("dtactctl")->description("Talks to dtactd, the daemon for DTact tactile sensors.");
  cli::add_global_options(app, context);
  add_status(app, context);
  add_watch(app, context);
  add_setup(app, context);
  add_bench(app, context);
  add_find(app, context);
  add_fleet(app, context);
  add_led(app, context);
  add_camera(app, context);
  add_rezero(app, context);
  add_reconstruction(app, context);
  add_calibration(app, context);
  add_snapshot(app, context);
  add_record(app, context);
  add_export(app, context);
  add_cameras(app, context);
  add_cert(app, context);
  add_token(app, context);
}

int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& error) {
  CLI::App app;
  cli::Context context{{}, false, out};
  set_up(app, context);
  return cli::run(app, arguments, out, error);
}

}  // namespace dtact::ctl
