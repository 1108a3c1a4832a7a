#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <utility>

#include "clients/web/request.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::web {

/// Bounds the connections that speak HTTP, and the WebSockets whose peer is not authenticated, so
/// that they cannot take all descriptors. Beyond a limit a new one takes the place of the oldest,
/// of the same host or of the host with most of them: that one has sent half a request, waits for a
/// refusal, is idle or has sent no token. On one thread.
class HttpLimits {
 public:
  static constexpr std::size_t kMax = 128;
  static constexpr std::size_t kMaxOfHost = 64;

  /// A connection's place, which it keeps until this is gone.
  class Ticket {
   public:
    ~Ticket();
    Ticket(const Ticket&) = delete;
    Ticket& operator=(const Ticket&) = delete;

    std::function<void()> close;  ///< Ends the connection.

   private:
    friend class HttpLimits;
    Ticket(std::weak_ptr<std::list<Ticket*>> open, std::string host)
        : open_(std::move(open)), host_(std::move(host)) {}

    std::weak_ptr<std::list<Ticket*>> open_;
    std::string host_;
  };

  /// A place for a connection of this Peer.host; another is closed when there is none.
  [[nodiscard]] std::shared_ptr<Ticket> admit(const std::string& host);

 private:
  std::shared_ptr<std::list<Ticket*>> open_ =
      std::make_shared<std::list<Ticket*>>();  ///< Oldest first.
};

/// Speaks HTTP/1.1 with a peer until it leaves, upgrades to a WebSocket, breaks a limit or is
/// silent for too long: GET and HEAD without a body, heads of at most 8 kB. `ticket` is kept
/// meanwhile, and passed to Upgrade::open. Without `tls` plain; it must outlive the connection.
void serve_http(boost::asio::ip::tcp::socket socket, net::Peer peer, boost::asio::ssl::context* tls,
                std::weak_ptr<Site> site, std::shared_ptr<HttpLimits::Ticket> ticket,
                std::chrono::milliseconds peer_timeout);

}  // namespace dtact::web
