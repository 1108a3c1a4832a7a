#pragma once

#include <fmt/format.h>

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "daemon/serve/net_config.hpp"

namespace dtact::net {

/// Accepts on a bound acceptor of any protocol. What comes before `on_socket` is the same for TCP
/// and Unix sockets.
template <typename Protocol>
class AcceptLoop : public std::enable_shared_from_this<AcceptLoop<Protocol>> {
 public:
  using Acceptor = typename Protocol::acceptor;
  using Socket = typename Protocol::socket;

  AcceptLoop(Acceptor acceptor, const Log& log, std::function<void(Socket)> on_socket)
      : acceptor_(std::move(acceptor)),
        timer_(acceptor_.get_executor()),
        log_(log),
        on_socket_(std::move(on_socket)) {}

  void accept() {
    acceptor_.async_accept([weak = this->weak_from_this()](const Error& error, Socket socket) {
      const auto self = weak.lock();
      if (self == nullptr || !self->acceptor_.is_open()) return;
      // A client that left before it was accepted is no trouble of ours.
      if (error && error != boost::asio::error::connection_aborted) {
        return self->retry_later(error.message());
      }
      self->reported_ = false;
      if (!error) self->on_socket_(std::move(socket));
      self->accept();
    });
  }
  void stop() {
    Error ignored;
    acceptor_.close(ignored);
    timer_.cancel();
  }
  [[nodiscard]] const Acceptor& acceptor() const noexcept { return acceptor_; }

 private:
  using Error = boost::system::error_code;

  /// Without descriptors every accept fails at once: wait instead of spinning, and say it once.
  void retry_later(const std::string& reason) {
    if (!std::exchange(reported_, true)) {
      log_({LogLevel::warning,
            fmt::format("cannot accept clients: {}; trying again every second", reason)});
    }
    timer_.expires_after(std::chrono::seconds(1));
    timer_.async_wait([weak = this->weak_from_this()](const Error& error) {
      const auto self = weak.lock();
      if (!error && self != nullptr && self->acceptor_.is_open()) self->accept();
    });
  }

  Acceptor acceptor_;
  boost::asio::steady_timer timer_;
  const Log& log_;
  std::function<void(Socket)> on_socket_;
  bool reported_ = false;  ///< The present trouble has been logged.
};

}  // namespace dtact::net
