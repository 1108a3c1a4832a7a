#include "daemon/net/transport.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>

#include <boost/asio/write.hpp>
#include <utility>

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

/// Bytes of a frame that the kernel may hold unsent. Beyond that a write waits, so that an answer
/// comes after the frame being sent and not after several that lie in the socket's buffer. Large
/// enough to keep a gigabit link busy for a millisecond, the time in which this thread runs again.
constexpr int kNotSentLowWater = 128 * 1024;

void prepare(tcp::socket& socket, std::chrono::milliseconds dead_after) {
  const auto set = [&socket](int level, int option, int value) {
    // Each is an improvement and none a condition: without it the connection is only slower to
    // answer or to be found dead.
    (void)::setsockopt(socket.native_handle(), level, option, &value, sizeof value);
  };
  set(IPPROTO_TCP, TCP_NODELAY, 1);
  set(IPPROTO_TCP, TCP_NOTSENT_LOWAT, kNotSentLowWater);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, static_cast<int>(dead_after.count()));
  // An idle client has nothing unacknowledged: probe it, so that a vanished one is let go.
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 15);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 5);
  set(IPPROTO_TCP, TCP_KEEPCNT, 3);
}

std::string describe(const tcp::socket& socket) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  // A client may be gone before its connection was accepted; reading will say so.
  return error ? "unknown" : fmt::format("{}:{}", peer.address().to_string(), peer.port());
}

class TcpTransport : public Transport {
 public:
  TcpTransport(tcp::socket socket, std::string endpoint)
      : Transport({describe(socket), std::move(endpoint)}), socket_(std::move(socket)) {}

  void read_some(asio::mutable_buffer into, Done done) override {
    socket_.async_read_some(into, std::move(done));
  }
  void write(const Parts& parts, Done done) override {
    asio::async_write(socket_, parts, std::move(done));
  }
  void shutdown_send() override {
    error_code ignored;
    socket_.shutdown(tcp::socket::shutdown_send, ignored);
  }
  void close() override {
    error_code ignored;
    socket_.close(ignored);
  }
  asio::any_io_executor executor() override { return socket_.get_executor(); }

 private:
  tcp::socket socket_;
};

}  // namespace

std::unique_ptr<Transport> over_tcp(tcp::socket socket, std::string endpoint,
                                    std::chrono::milliseconds dead_after) {
  prepare(socket, dead_after);
  return std::make_unique<TcpTransport>(std::move(socket), std::move(endpoint));
}

}  // namespace dtact::net
