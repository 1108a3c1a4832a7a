#pragma once

#include "clients/common/program.hpp"

namespace dtact::ctl {

/// guided --radius-mm 4 --mm-per-px S [--folder DIR]: the session with a running daemon.
void add_guided(CLI::App& app, cli::Context& context);

}  // namespace dtact::ctl
