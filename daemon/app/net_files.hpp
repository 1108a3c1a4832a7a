#pragma once

#include "daemon/serve/net_config.hpp"

namespace dtact::app {

/// Puts the file that systemd handed in where certificate, key and token file are
/// "credential:NAME". Throws as resolve_credential().
void resolve_credentials(net::NetConfig& config);

/// Reads certificate, key and token file and lets go of them. Throws std::runtime_error with file
/// and remedy where a start would, and a reload keep what it has. A credential is looked at where
/// this process has the unit's.
void check_net_files(net::NetConfig config);

}  // namespace dtact::app
