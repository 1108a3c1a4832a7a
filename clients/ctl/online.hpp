#pragma once

#include <iosfwd>

#include "clients/cpp/client.hpp"

namespace CLI {
class App;
}

// The commands that talk to a running daemon. Each add_…() adds its command to `app`; the command
// runs while the command line is parsed and throws what goes wrong.
namespace dtact::ctl {

/// What all of them share. Filled while the command line is parsed.
struct Context {
  client::Options target;
  bool json = false;
  std::ostream& out;
};

void add_status(CLI::App& app, Context& context);
void add_watch(CLI::App& app, Context& context);
void add_led(CLI::App& app, Context& context);
void add_rezero(CLI::App& app, Context& context);
void add_snapshot(CLI::App& app, Context& context);
void add_calibration(CLI::App& app, Context& context);
/// To the command `calibrate`, which has to be there.
void add_guided_calibration(CLI::App& app, Context& context);

}  // namespace dtact::ctl
