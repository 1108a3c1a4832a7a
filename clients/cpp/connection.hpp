#pragma once

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "proto/framing.hpp"

namespace dtact::client {

/// A TCP connection that carries messages, with deadlines. Not part of the library's interface.
class Connection {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// Throws ConnectionError naming the remedy. Looking a name up is not bounded by the deadline.
  Connection(const std::string& host, std::uint16_t port, Deadline deadline);

  /// One message with its length. Throws ConnectionError, TimeoutError.
  void write(std::string_view message, Deadline deadline);
  /// The next message, valid until the next call; null when none came in time. Throws
  /// ConnectionError, ProtocolError.
  [[nodiscard]] const std::string* read(Deadline deadline);
  /// The other end is on this machine.
  [[nodiscard]] bool local() const noexcept { return local_; }

 private:
  void connect(const boost::asio::ip::tcp::endpoint& endpoint, Deadline deadline,
               boost::system::error_code& error);
  /// False: the deadline passed first.
  [[nodiscard]] bool wait(short events, Deadline deadline);
  void send(std::string_view bytes, Deadline deadline);

  std::string name_;  ///< "host port 7377", for messages.
  boost::asio::io_context io_;
  boost::asio::ip::tcp::socket socket_;
  bool local_ = false;
  wire::MessageDecoder decoder_;
  std::array<char, 65536> buffer_{};
  std::string_view unread_;  ///< Part of buffer_.
};

}  // namespace dtact::client
