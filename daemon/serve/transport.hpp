#pragma once

#include <array>
#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/system/error_code.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

namespace dtact::net {

/// Who is at the other end, and by which way it came.
struct Peer {
  std::string address;   ///< For logs and status: "192.168.1.7:40312", "pid 811 (uid 1000)".
  std::string endpoint;  ///< The Endpoint.address it came by.
  /// What limits for each address count: "this machine" for every loopback address, the IPv4
  /// address, the first half of an IPv6 one, which is what one network has at least, or the user.
  std::string host;
  /// The kernel says that it is root, the daemon's own user or of the daemon's group: it needs no
  /// token.
  bool trusted = false;
};

/// One connection, whatever it runs over: what a Session reads from and writes to. All calls and
/// handlers are on the network thread; at most one read and one write at a time. It must outlive
/// its handlers: each is called once, with an error after close().
class Transport {
 public:
  using Done = std::function<void(const boost::system::error_code&, std::size_t)>;
  /// Written one after the other; those that are not needed are empty.
  using Parts = std::array<boost::asio::const_buffer, 3>;

  explicit Transport(Peer peer) : peer_(std::move(peer)) {}
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  virtual ~Transport() = default;

  /// The peer has said Hello, with a right token where one is needed.
  virtual void on_authenticated() {}
  /// Before anything else.
  virtual void handshake(std::function<void(const boost::system::error_code&)> done) = 0;
  /// At least one byte, or an error; asio::error::eof when the peer sends nothing more.
  virtual void read_some(boost::asio::mutable_buffer into, Done done) = 0;
  /// All of the parts, or an error. What they point to must stay until then.
  virtual void write(const Parts& parts, Done done) = 0;
  /// Nothing more is sent; the peer sees the end after what was written. `held` is kept until that
  /// is done.
  virtual void shutdown_send(std::shared_ptr<void> held) = 0;
  virtual void close() = 0;
  [[nodiscard]] virtual boost::asio::any_io_executor executor() = 0;

  [[nodiscard]] const Peer& peer() const noexcept { return peer_; }

 private:
  Peer peer_;
};

/// Sets the options of a socket that frames are sent through: answers at once, and frames that do
/// not queue up in the kernel.
void prepare(boost::asio::ip::tcp::socket& socket);
/// Who is at the other end.
[[nodiscard]] Peer peer_of(const boost::asio::ip::tcp::socket& socket, std::string endpoint);

/// TCP over a prepared socket; a peer that is gone is found after `peer_timeout`, one that only
/// does not read kept (TcpWatch): reading then ends with asio::error::timed_out. Without `tls`
/// plain; it must outlive the transport.
[[nodiscard]] std::unique_ptr<Transport> over_tcp(boost::asio::ip::tcp::socket socket, Peer peer,
                                                  std::chrono::milliseconds peer_timeout,
                                                  boost::asio::ssl::context* tls);

/// A Unix socket; the peer is who it was when it connected (SO_PEERCRED).
[[nodiscard]] std::unique_ptr<Transport> over_unix(
    boost::asio::local::stream_protocol::socket socket, std::string endpoint);

}  // namespace dtact::net
