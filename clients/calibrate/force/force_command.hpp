#pragma once

#include "clients/common/program.hpp"

namespace dtact::force {

/// force --calibration cal/ --pair press.png@0.52 ... [--pairs readings.csv] [-o new/]: the gel's
/// Young's modulus from a scale's readings.
void add_force(CLI::App& app, cli::Context& context);

}  // namespace dtact::force
