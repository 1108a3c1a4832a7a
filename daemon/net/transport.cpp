#include "daemon/net/transport.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>

#include <boost/asio/error.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "daemon/net/tcp_watch.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

/// Bytes of a frame that the kernel may hold unsent. Beyond that a write waits, so that an answer
/// comes after the frame being sent and not after several that lie in the socket's buffer. Large
/// enough to keep a gigabit link busy for a millisecond, the time in which this thread runs again.
constexpr int kNotSentLowWater = 128 * 1024;

void prepare(tcp::socket& socket) {
  const auto set = [&socket](int option, int value) {
    // Each is an improvement and none a condition: without it the connection is only slower.
    (void)::setsockopt(socket.native_handle(), IPPROTO_TCP, option, &value, sizeof value);
  };
  set(TCP_NODELAY, 1);
  set(TCP_NOTSENT_LOWAT, kNotSentLowWater);
}

std::string describe(const tcp::socket& socket) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  // A client may be gone before its connection was accepted; reading will say so.
  return error ? "unknown" : fmt::format("{}:{}", peer.address().to_string(), peer.port());
}

class TcpTransport : public Transport {
 public:
  TcpTransport(tcp::socket socket, std::string endpoint, std::chrono::milliseconds dead_after)
      : Transport({describe(socket), std::move(endpoint)}),
        socket_(std::move(socket)),
        watch_(std::make_shared<TcpWatch>(executor(), socket_.native_handle(), dead_after)) {
    watch_->start([this] {
      dead_ = true;
      error_code ignored;
      socket_.cancel(ignored);
    });
  }
  ~TcpTransport() override { watch_->stop(); }

  void read_some(asio::mutable_buffer into, Done done) override {
    socket_.async_read_some(into,
                            [this, done = std::move(done)](error_code error, std::size_t size) {
                              if (dead_) error = asio::error::timed_out;
                              done(error, size);
                            });
  }
  void write(const Parts& parts, Done done) override {
    asio::async_write(socket_, parts, std::move(done));
  }
  void shutdown_send() override {
    error_code ignored;
    socket_.shutdown(tcp::socket::shutdown_send, ignored);
  }
  void close() override {
    watch_->stop();
    error_code ignored;
    socket_.close(ignored);
  }
  asio::any_io_executor executor() override { return socket_.get_executor(); }

 private:
  tcp::socket socket_;
  std::shared_ptr<TcpWatch> watch_;
  bool dead_ = false;
};

}  // namespace

std::unique_ptr<Transport> over_tcp(tcp::socket socket, std::string endpoint,
                                    std::chrono::milliseconds dead_after) {
  prepare(socket);
  return std::make_unique<TcpTransport>(std::move(socket), std::move(endpoint), dead_after);
}

}  // namespace dtact::net
