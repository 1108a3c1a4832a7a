#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/net/net_config.hpp"
#include "daemon/net/transport.hpp"

namespace dtact::net {

/// Takes connections and hands each to `on_connection`.
class Listener : public std::enable_shared_from_this<Listener> {
 public:
  using OnConnection = std::function<void(std::unique_ptr<Transport>)>;

  /// Binds and listens, also on an address that no interface has yet: clients can connect once one
  /// has. Throws std::runtime_error naming address, port and remedy.
  Listener(boost::asio::io_context& io, const NetConfig& config, OnConnection on_connection);

  void start() { accept(); }
  void stop();
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  void accept();
  void retry_later(const std::string& reason);

  const NetConfig& config_;
  boost::asio::ip::tcp::acceptor acceptor_;
  std::string endpoint_;  ///< Where it listens, as Endpoint.address says it.
  boost::asio::steady_timer timer_;
  OnConnection on_connection_;
  bool told_ = false;  ///< The present trouble has been logged.
};

}  // namespace dtact::net
