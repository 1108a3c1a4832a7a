#pragma once

#include "daemon/app/config.hpp"

namespace dtact::app {

/// Puts the daemon together, runs it until SIGTERM or SIGINT and takes it apart again. Throws
/// std::exception, with a sentence that names the remedy, when it cannot start.
void run_daemon(const Config& config);

}  // namespace dtact::app
