#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/system/error_code.hpp>
#include <cstddef>
#include <functional>
#include <memory>

#include "daemon/serve/transport.hpp"

namespace dtact::web {

/// An open WebSocket over TCP or TLS. Like net::Transport, it has at most one read and one write at
/// a time. Each handler is called once, with an error after close(). It must outlive the calls.
class WebSocket {
 public:
  struct Received {
    std::size_t bytes = 0;
    bool text = false;  ///< Else binary.
    bool end = false;   ///< Message ends.
  };
  using OnRead = std::function<void(const boost::system::error_code&, Received)>;
  using Parts = net::Transport::Parts;
  using Done = net::Transport::Done;

  WebSocket() = default;
  WebSocket(const WebSocket&) = delete;
  WebSocket& operator=(const WebSocket&) = delete;
  virtual ~WebSocket() = default;

  /// Some bytes of a message, maybe none, or an error; asio::error::eof when the peer has closed.
  virtual void read_some(boost::asio::mutable_buffer into, OnRead done) = 0;
  /// All of the parts as one message.
  virtual void write(const Parts& parts, bool text, Done done) = 0;
  /// Says that nothing more comes. `held` is kept until that is done.
  virtual void end(std::shared_ptr<void> held) = 0;
  virtual void close() = 0;
  [[nodiscard]] virtual boost::asio::any_io_executor executor() = 0;
};

}  // namespace dtact::web
