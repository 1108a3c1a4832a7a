#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>

#include "clients/web/web_socket.hpp"
#include "daemon/serve/transport.hpp"

namespace dtact::web {

/// The daemon's wire in a WebSocket's binary messages, and text messages of the gateway's own
/// beside it, of which the newest two are sent.
class WireTransport : public net::Transport {
 public:
  /// `place`: see Upgrade::open.
  WireTransport(std::shared_ptr<WebSocket> socket, net::Peer peer, std::shared_ptr<void> place);

  /// Sends a text as soon as what is being written is through. Of those that wait the last two
  /// stay: a page that hears of the end of a loss alone would not subscribe again.
  void send_text(std::string text);

  void on_authenticated() override { place_.reset(); }
  void handshake(std::function<void(const boost::system::error_code&)> done) override { done({}); }
  void read_some(boost::asio::mutable_buffer into, Done done) override;
  void write(const Parts& parts, Done done) override;
  void shutdown_send(std::shared_ptr<void> held) override;
  void close() override { socket_->close(); }
  [[nodiscard]] boost::asio::any_io_executor executor() override { return socket_->executor(); }

 private:
  void write_text();

  std::shared_ptr<WebSocket> socket_;  ///< Shared with a text on its way.
  std::shared_ptr<void> place_;
  bool writing_ = false;
  std::deque<std::string> texts_;  ///< Wait.
  std::function<void()> next_;     ///< What came while a text was being written.
  std::shared_ptr<WireTransport*> self_ = std::make_shared<WireTransport*>(this);
};

}  // namespace dtact::web
