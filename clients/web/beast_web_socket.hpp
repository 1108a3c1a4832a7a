#pragma once

#include <boost/asio/error.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <chrono>
#include <memory>
#include <utility>

#include "clients/web/web_socket.hpp"
#include "daemon/serve/tcp_watch.hpp"

namespace dtact::web {

/// A WebSocket whose handshake is done. `Stream` is a socket, or TLS over one. A peer that is gone
/// without a word is found after `peer_timeout`, one that only does not read is kept: reading then
/// ends with asio::error::timed_out.
template <typename Stream>
class BeastWebSocket final : public WebSocket {
  using Error = boost::system::error_code;
  using Channel = boost::beast::websocket::stream<Stream>;

 public:
  BeastWebSocket(std::unique_ptr<Channel> channel, std::chrono::milliseconds peer_timeout)
      : channel_(std::move(channel)),
        watch_(std::make_shared<net::TcpWatch>(channel_->get_executor(), socket().native_handle(),
                                               peer_timeout)) {
    watch_->start([this] {
      dead_ = true;
      Error ignored;
      socket().cancel(ignored);
    });
  }
  ~BeastWebSocket() override { watch_->stop(); }
  BeastWebSocket(const BeastWebSocket&) = delete;
  BeastWebSocket& operator=(const BeastWebSocket&) = delete;

  void read_some(boost::asio::mutable_buffer into, OnRead done) override {
    channel_->async_read_some(into, [this, done = std::move(done)](Error error, std::size_t bytes) {
      namespace asio = boost::asio;
      if (dead_) error = asio::error::timed_out;
      const bool left = error == boost::beast::websocket::error::closed ||
                        error == asio::ssl::error::stream_truncated;
      if (left) error = asio::error::eof;
      done(error, {bytes, channel_->got_text(), channel_->is_message_done()});
    });
  }
  void write(const Parts& parts, bool text, Done done) override {
    channel_->text(text);
    channel_->async_write(parts, std::move(done));
  }
  void end(std::shared_ptr<void> held) override {
    channel_->async_close(boost::beast::websocket::close_code::normal,
                          [held = std::move(held)](const Error&) {});
  }
  void close() override {
    watch_->stop();
    Error ignored;
    socket().close(ignored);
  }
  boost::asio::any_io_executor executor() override { return channel_->get_executor(); }

 private:
  auto& socket() { return boost::beast::get_lowest_layer(*channel_); }

  std::unique_ptr<Channel> channel_;
  std::shared_ptr<net::TcpWatch> watch_;
  bool dead_ = false;
};

}  // namespace dtact::web
