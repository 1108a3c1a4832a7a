#pragma once

#include <boost/asio/signal_set.hpp>
#include <functional>

#include "daemon/serve/net_config.hpp"

namespace CLI {
class App;
}

namespace dtact::cli {

/// Where a program that serves the wire listens and whom it lets in: --listen, --listen-port,
/// --tokens, --tls-certificate, --tls-key and --listen-insecure. What `settings` holds is the
/// default; it must outlive the parsing.
void add_listen_options(CLI::App& command, net::NetConfig& settings);

/// Calls `reload` at each SIGHUP that `hangups` waits for, until it is cancelled, and logs what
/// came of it. What is passed by reference must outlive that.
void reload_at_hangup(boost::asio::signal_set& hangups, const net::Log& log,
                      const std::function<void()>& reload);

}  // namespace dtact::cli
