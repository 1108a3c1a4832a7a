#pragma once

#include "daemon/serve/net_config.hpp"

namespace CLI {
class App;
}

namespace dtact::cli {

/// Where a program that serves the wire listens and whom it lets in: --listen, --listen-port,
/// --tokens, --tls-certificate, --tls-key and --listen-insecure. What `settings` holds is the
/// default; it must outlive the parsing.
void add_listen_options(CLI::App& command, net::NetConfig& settings);

}  // namespace dtact::cli
