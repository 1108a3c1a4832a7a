#pragma once

#include "clients/common/program.hpp"

namespace dtact::ctl {

/// Adds the command that takes a recording apart; it needs no daemon.
void add_export(CLI::App& app, cli::Context& context);

}  // namespace dtact::ctl
