#include "daemon/serve/transport.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>

#include <algorithm>
#include <boost/asio/error.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "daemon/serve/peer_credentials.hpp"
#include "daemon/serve/tcp_watch.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
namespace ssl = asio::ssl;
using asio::ip::tcp;
using boost::system::error_code;
using Unix = asio::local::stream_protocol;

/// Bytes of a frame that the kernel may hold unsent. Beyond that a write waits, so that an answer
/// comes after the frame being sent and not after several that lie in the socket's buffer. Large
/// enough to keep a gigabit link busy for a millisecond, the time in which this thread runs again.
constexpr int kNotSentLowWater = 128 * 1024;

/// One that dials into a dual-stack listener by IPv4 is the same as one that dials by IPv4.
asio::ip::address unmapped(const asio::ip::address& address) {
  if (!address.is_v6() || !address.to_v6().is_v4_mapped()) return address;
  return asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
}

std::string host_of(const asio::ip::address& address) {
  // Any program may take any address of 127.0.0.0/8.
  if (address.is_loopback()) return "this machine";
  if (address.is_v4()) return address.to_string();
  auto bytes = address.to_v6().to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
  return asio::ip::address_v6(bytes).to_string() + "/64";
}

/// What all have in common: a stream of Asio's. `Stream` is a socket, or TLS over one.
template <typename Stream>
class StreamTransport : public Transport {
 public:
  template <typename... Arguments>
  explicit StreamTransport(Peer peer, Arguments&&... arguments)
      : Transport(std::move(peer)), stream_(std::forward<Arguments>(arguments)...) {}

  void handshake(std::function<void(const error_code&)> done) override { done({}); }
  void read_some(asio::mutable_buffer into, Done done) override {
    stream_.async_read_some(into, std::move(done));
  }
  void write(const Parts& parts, Done done) override {
    asio::async_write(stream_, parts, std::move(done));
  }
  void shutdown_send(std::shared_ptr<void> /*held*/) override {
    error_code ignored;
    stream_.lowest_layer().shutdown(asio::socket_base::shutdown_send, ignored);
  }
  void close() override {
    error_code ignored;
    stream_.lowest_layer().close(ignored);
  }
  asio::any_io_executor executor() override { return stream_.get_executor(); }

 protected:
  Stream& stream() noexcept { return stream_; }

 private:
  Stream stream_;
};

template <typename Stream>
class TcpTransport : public StreamTransport<Stream> {
  using Base = StreamTransport<Stream>;

 public:
  template <typename... Arguments>
  TcpTransport(Peer peer, std::chrono::milliseconds peer_timeout, Arguments&&... arguments)
      : Base(std::move(peer), std::forward<Arguments>(arguments)...),
        watch_(std::make_shared<TcpWatch>(
            this->executor(), this->stream().lowest_layer().native_handle(), peer_timeout)) {
    watch_->start([this] {
      dead_ = true;
      error_code ignored;
      this->stream().lowest_layer().cancel(ignored);
    });
  }
  ~TcpTransport() override { watch_->stop(); }

  void read_some(asio::mutable_buffer into, Transport::Done done) override {
    Base::read_some(into, [this, done = std::move(done)](error_code error, std::size_t size) {
      if (dead_) error = asio::error::timed_out;
      // TLS that was not ended in its own way: nothing is cut off, since messages have lengths.
      if (error == ssl::error::stream_truncated) error = asio::error::eof;
      done(error, size);
    });
  }
  void close() override {
    watch_->stop();
    Base::close();
  }

 private:
  std::shared_ptr<TcpWatch> watch_;
  bool dead_ = false;
};

class TlsTransport : public TcpTransport<ssl::stream<tcp::socket>> {
 public:
  using TcpTransport::TcpTransport;

  void handshake(std::function<void(const error_code&)> done) override {
    stream().async_handshake(ssl::stream_base::server, std::move(done));
  }
  void shutdown_send(std::shared_ptr<void> held) override {
    stream().async_shutdown([held = std::move(held)](const error_code&) {});
  }
};

}  // namespace

void prepare(tcp::socket& socket) {
  const auto set = [&socket](int option, int value) {
    // Each is optional: without it the connection is only slower.
    (void)::setsockopt(socket.native_handle(), IPPROTO_TCP, option, &value, sizeof value);
  };
  set(TCP_NODELAY, 1);
  set(TCP_NOTSENT_LOWAT, kNotSentLowWater);
}

Peer peer_of(const tcp::socket& socket, std::string endpoint) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  // A client may be gone before its connection was accepted; reading will say so.
  if (error) return {"unknown", std::move(endpoint), "unknown", false};
  return {fmt::format("{}:{}", peer.address().to_string(), peer.port()), std::move(endpoint),
          host_of(unmapped(peer.address())), false};
}

std::unique_ptr<Transport> over_tcp(tcp::socket socket, Peer peer,
                                    std::chrono::milliseconds peer_timeout, ssl::context* tls) {
  if (tls != nullptr) {
    return std::make_unique<TlsTransport>(std::move(peer), peer_timeout, std::move(socket), *tls);
  }
  return std::make_unique<TcpTransport<tcp::socket>>(std::move(peer), peer_timeout,
                                                     std::move(socket));
}

std::unique_ptr<Transport> over_unix(Unix::socket socket, std::string endpoint) {
  const PeerCredentials peer = peer_credentials(socket.native_handle());
  return std::make_unique<StreamTransport<Unix::socket>>(
      Peer{peer.text, std::move(endpoint),
           fmt::format("uid {}{}", peer.uid, peer.trusted ? " (needs no token)" : ""),
           peer.trusted},
      std::move(socket));
}

}  // namespace dtact::net
