#pragma once

#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/web/web_socket.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::web {

using Request = boost::beast::http::request<boost::beast::http::empty_body>;

/// What a request is answered with.
struct Answer {
  boost::beast::http::status status = boost::beast::http::status::ok;
  std::string_view type = "text/plain; charset=utf-8";
  std::string text = {};               ///< The body, …
  std::string_view bytes = {};         ///< … unless this is it, which lives as long as the program.
  std::string tag = {};                ///< ETag; empty: browsers must not cache it.
  std::chrono::milliseconds delay{0};  ///< Is sent after this.
};

inline Answer refusal(boost::beast::http::status status, std::string sentence) {
  return {.status = status, .text = std::move(sentence)};
}

/// What becomes of a WebSocket, or why there is none.
struct Upgrade {
  Answer refusal = {};           ///< Where `open` is null.
  std::string subprotocol = {};  ///< The chosen one; empty: none was offered.
  std::size_t max_message = 0;   ///< From the peer, bytes.
  /// The last argument is the peer's place among the connections of unauthenticated peers, to be
  /// kept until it is authenticated.
  std::function<void(std::shared_ptr<WebSocket>, net::Peer, std::shared_ptr<void>)> open = {};
};

/// What HTTP connections are there for. On their thread.
class Site {
 public:
  Site() = default;
  Site(const Site&) = delete;
  Site& operator=(const Site&) = delete;
  virtual ~Site() = default;

  [[nodiscard]] virtual Answer answer(const Request& request, const net::Peer& peer) = 0;
  [[nodiscard]] virtual Upgrade upgrade(const Request& request, const net::Peer& peer) = 0;
};

}  // namespace dtact::web
