#pragma once

#include "clients/common/program.hpp"

namespace dtact::reprocess {

/// reprocess RECORDING --calibration NEW -o OUT.mcap: recomputes the depth of a recording.
void add_reprocess(CLI::App& app, cli::Context& context);

}  // namespace dtact::reprocess
