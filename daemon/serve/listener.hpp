#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "daemon/serve/net_config.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::net {

/// Takes connections at one endpoint and hands each on.
class Listener {
 public:
  Listener() = default;
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  virtual ~Listener() = default;

  virtual void start() = 0;
  virtual void stop() = 0;
  /// As Endpoint.address.
  [[nodiscard]] virtual const std::string& address() const = 0;
  /// 0 for a Unix socket.
  [[nodiscard]] virtual std::uint16_t port() const = 0;
};

/// A TCP connection as it came, with the socket's options set, and who is at its other end.
using OnSocket = std::function<void(boost::asio::ip::tcp::socket, Peer)>;

/// Binds config.address and listens, also on an address that no interface has yet: clients can
/// connect once one has. Throws std::runtime_error naming address, port and fix. What is passed
/// by reference must outlive it.
[[nodiscard]] std::shared_ptr<Listener> listen_tcp(boost::asio::io_context& io,
                                                   const NetConfig& config, OnSocket on_socket);

using OnConnection = std::function<void(std::unique_ptr<Transport>)>;

/// Binds config.unix_socket, open to every user of this machine: Peer.trusted marks users without
/// need of a token. Replaces a stale socket, and removes its own at the
/// end. Throws std::runtime_error with path and fix, also when another program listens there.
[[nodiscard]] std::shared_ptr<Listener> listen_unix(boost::asio::io_context& io,
                                                    const NetConfig& config,
                                                    OnConnection on_connection);

}  // namespace dtact::net
