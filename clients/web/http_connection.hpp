#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <string>

#include "clients/web/request.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::web {

/// Counts the connections that speak HTTP, so that they cannot take all descriptors. On one thread.
class HttpLimits {
 public:
  static constexpr std::size_t kMax = 128;
  static constexpr std::size_t kMaxOfHost = 64;

  /// Counts until the returned is gone; null: there are too many, of all or of this Peer.host.
  [[nodiscard]] std::shared_ptr<void> admit(const std::string& host);

 private:
  struct Counts {
    std::size_t all = 0;
    std::map<std::string, std::size_t> hosts;
  };
  std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
};

/// Speaks HTTP/1.1 with a peer until it leaves, upgrades to a WebSocket, breaks a limit or is
/// silent for too long: GET and HEAD without a body, heads of at most 8 kB. `ticket` is kept
/// meanwhile. Without `tls` plain; it must outlive the connection.
void serve_http(boost::asio::ip::tcp::socket socket, net::Peer peer, boost::asio::ssl::context* tls,
                std::weak_ptr<Site> site, std::shared_ptr<void> ticket,
                std::chrono::milliseconds peer_timeout);

}  // namespace dtact::web
