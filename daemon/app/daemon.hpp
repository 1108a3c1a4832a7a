#pragma once

#include <functional>

#include "daemon/app/config.hpp"

namespace dtact::app {

/// Puts the daemon together, runs it until SIGTERM or SIGINT and takes it apart again. At SIGHUP it
/// takes from `load`() what can change while it runs. Throws std::exception, with a sentence that
/// names the fix, when it cannot start.
void run_daemon(const Config& config, const std::function<Config()>& load);

}  // namespace dtact::app
