#pragma once

#include "clients/common/program.hpp"

namespace dtact::reprocess {

/// reprocess RECORDING --calibration NEW -o OUT.mcap: makes the depth of a recording anew.
void add_reprocess(CLI::App& app, cli::Context& context);

}  // namespace dtact::reprocess
