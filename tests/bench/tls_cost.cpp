// Cost of TLS on the thread that sends frames: its CPU time a frame over plain TCP, TLS and a Unix
// socket, rounds interleaved, one client that reads as fast as it can.
//   bench_tls [FRAMES a round] [ROUNDS]
#include <fmt/format.h>
#include <openssl/ssl.h>
#include <pthread.h>
#include <sys/un.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "clients/ctl/certificate.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::bench {
namespace {

using namespace net::test;

/// A server on a thread whose CPU time can be read.
class Served {
 public:
  explicit Served(net::NetConfig config) {
    config.port = 0;
    server_ = std::make_unique<net::Server>(io_, config, port, store_);
    thread_ = std::thread([this] { io_.run(); });
  }
  ~Served() {
    boost::asio::post(io_, [this] { server_->stop(); });
    thread_.join();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

  [[nodiscard]] std::uint16_t tcp_port() const { return server_->port(); }
  [[nodiscard]] double cpu_us() {
    clockid_t clock{};
    timespec now{};
    if (::pthread_getcpuclockid(thread_.native_handle(), &clock) != 0 ||
        ::clock_gettime(clock, &now) != 0) {
      throw std::runtime_error("the thread's CPU time cannot be read");
    }
    return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) / 1e3;
  }

  FakePort port;

 private:
  FakeStore store_;
  boost::asio::io_context io_;
  std::unique_ptr<net::Server> server_;
  std::thread thread_;
};

/// A stream of messages over a socket, with TLS or without.
class Stream {
 public:
  Stream(base::UniqueFd fd, bool tls) : fd_(std::move(fd)) {
    if (!tls) return;
    context_ = ::SSL_CTX_new(::TLS_client_method());
    ssl_ = ::SSL_new(context_);
    ::SSL_set_fd(ssl_, fd_.get());
    if (::SSL_connect(ssl_) != 1) throw std::runtime_error("no TLS");
  }
  ~Stream() {
    ::SSL_free(ssl_);
    ::SSL_CTX_free(context_);
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  void request(v1::ClientMessage message) {
    message.set_id(++id_);
    const auto length = wire::encode_length(message.ByteSizeLong());
    std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&bytes);
    const auto size = static_cast<int>(bytes.size());
    const auto sent = ssl_ != nullptr ? ::SSL_write(ssl_, bytes.data(), size)
                                      : ::send(fd_.get(), bytes.data(), bytes.size(), 0);
    if (sent != size) throw std::runtime_error("the request was not sent");
    (void)receive();
  }
  /// Number of bytes of the next message.
  std::size_t receive() {
    while (decoder_.feed(unread_) != wire::MessageDecoder::Result::message) {
      const auto n = ssl_ != nullptr
                         ? ::SSL_read(ssl_, buffer_.data(), static_cast<int>(buffer_.size()))
                         : ::recv(fd_.get(), buffer_.data(), buffer_.size(), 0);
      if (n <= 0) throw std::runtime_error("the connection ended");
      unread_ = {buffer_.data(), static_cast<std::size_t>(n)};
    }
    return decoder_.message().size();
  }

 private:
  base::UniqueFd fd_;
  SSL_CTX* context_ = nullptr;
  SSL* ssl_ = nullptr;
  std::uint64_t id_ = 0;
  wire::MessageDecoder decoder_;
  std::vector<char> buffer_ = std::vector<char>(1 << 18);
  std::string_view unread_;
};

base::UniqueFd connected(int family, const sockaddr* address, socklen_t size) {
  base::UniqueFd fd(::socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (::connect(fd.get(), address, size) != 0) throw std::runtime_error("cannot connect");
  return fd;
}

base::UniqueFd over_tcp(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return connected(AF_INET, reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

base::UniqueFd over_unix(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(static_cast<char*>(address.sun_path), sizeof address.sun_path - 1);
  return connected(AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof address);
}

/// One kind of connection, kept open over all rounds.
struct Way {
  const char* name;
  Served& served;
  Stream stream;
};

double us_a_frame(Way& way, std::uint32_t side, int frames) {
  static std::uint64_t sequence = 0;
  const auto frame = make_frame(1, static_cast<int>(side), static_cast<int>(side));
  const double before = way.served.cpu_us();
  for (int i = 0; i < frames; ++i) {
    auto next = frame;
    next.camera.sequence = ++sequence;
    way.served.port.publish(std::move(next));
    (void)way.stream.receive();
  }
  return (way.served.cpu_us() - before) / frames;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void measure(int frames, int rounds) {
  const calibration::TempFolder folder;
  const auto pair = ctl::make_pair({"localhost"});
  net::NetConfig plain;
  plain.unix_socket = folder.path() / "socket";
  net::NetConfig tls;
  tls.tls_certificate = folder.path() / "crt";
  tls.tls_key = folder.path() / "key";
  base::write_file_atomically(tls.tls_certificate, pair.certificate);
  base::write_file_atomically(tls.tls_key, pair.key, 0600);
  Served served(plain);
  Served served_tls(tls);
  std::array<Way, 3> ways{
      Way{"plain TCP", served, Stream(over_tcp(served.tcp_port()), false)},
      Way{"TLS 1.3", served_tls, Stream(over_tcp(served_tls.tcp_port()), true)},
      Way{"Unix socket", served, Stream(over_unix(plain.unix_socket.string()), false)}};
  v1::ClientMessage hello;
  hello.mutable_hello()->set_major(1);
  v1::ClientMessage subscribe;
  subscribe.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  v1::ClientMessage end;
  end.mutable_subscribe();
  for (auto& way : ways) way.stream.request(hello);
  // Sizes of the default scene's map at full resolution, raw and encoded.
  for (const std::uint32_t side : {580U, 241U}) {
    std::map<std::string, std::vector<double>> times;
    for (int round = 0; round < rounds; ++round) {
      for (auto& way : ways) {
        way.stream.request(subscribe);
        times[way.name].push_back(us_a_frame(way, side, frames));
        way.stream.request(end);
      }
    }
    const double base = median(times["plain TCP"]);
    for (const auto& way : ways) {
      const double us = median(times[way.name]);
      std::cout << fmt::format(
          "{:>7} bytes  {:<12} {:7.1f} us a frame, x {:.2f}, {:.2f} % of a core at 60 fps\n",
          2 * side * side, way.name, us, us / base, us * 60 / 1e4);
    }
  }
}

}  // namespace
}  // namespace dtact::bench

int main(int argc, char** argv) {
  try {
    dtact::bench::measure(argc > 1 ? std::atoi(argv[1]) : 200, argc > 2 ? std::atoi(argv[2]) : 11);
  } catch (const std::exception& e) {
    std::cerr << "bench_tls: " << e.what() << '\n';
    return 1;
  }
  return 0;
}
