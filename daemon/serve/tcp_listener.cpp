#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <cerrno>
#include <stdexcept>
#include <utility>

#include "daemon/serve/accept_loop.hpp"
#include "daemon/serve/listener.hpp"
#include "daemon/serve/security.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using tcp = asio::ip::tcp;

tcp::endpoint endpoint_of(const NetConfig& config) { return {listen_address(config), config.port}; }

const char* fix_for(const error_code& error) {
  if (error == asio::error::address_in_use) {
    return "another dtactd may be running (systemctl status dtactd); stop it or choose another "
           "port";
  }
  if (error == asio::error::access_denied)
    return "ports below 1024 need a privilege; choose another";
  return "check the configured address and port";
}

/// bind() to an address that no interface has yet (ip(7)); needs no privilege.
void bind_to_absent(tcp::acceptor& acceptor, const tcp::endpoint& endpoint, error_code& error) {
  const bool v6 = endpoint.address().is_v6();
  const int yes = 1;
  if (::setsockopt(acceptor.native_handle(), v6 ? IPPROTO_IPV6 : IPPROTO_IP,
                   v6 ? IPV6_FREEBIND : IP_FREEBIND, &yes, sizeof yes) != 0) {
    error.assign(errno, boost::system::system_category());
    return;
  }
  acceptor.bind(endpoint, error);
}

tcp::acceptor listen(asio::io_context& io, const tcp::endpoint& endpoint, const Log& log) {
  tcp::acceptor acceptor(io);
  error_code error;
  const auto step = [&](auto call) {
    if (!error) call();
  };
  step([&] { acceptor.open(endpoint.protocol(), error); });
  // A daemon that starts again must not wait for its old connections to time out.
  step([&] { acceptor.set_option(tcp::acceptor::reuse_address(true), error); });
  step([&] {
    if (endpoint.address().is_v6()) acceptor.set_option(asio::ip::v6_only(false), error);
  });
  step([&] { acceptor.bind(endpoint, error); });
  if (error.value() == EADDRNOTAVAIL) {
    // DHCP may add the address any time after the start. The kernel accepts clients from then on;
    // retrying here would only be later. Clients cannot be informed either: they connect to that
    // address.
    error.clear();
    bind_to_absent(acceptor, endpoint, error);
    step([&] {
      log({LogLevel::warning,
           fmt::format(
               "no interface has the address {} yet: clients can connect as soon as one has "
               "(ip address shows what there is)",
               endpoint.address().to_string())});
    });
  }
  step([&] { acceptor.listen(asio::socket_base::max_listen_connections, error); });
  if (error) {
    throw std::runtime_error(fmt::format("cannot listen on {} port {}: {}; {}",
                                         endpoint.address().to_string(), endpoint.port(),
                                         error.message(), fix_for(error)));
  }
  return acceptor;
}

std::string describe(const tcp::endpoint& endpoint) {
  const std::string address = endpoint.address().to_string();
  return fmt::format(fmt::runtime(endpoint.address().is_v6() ? "[{}]:{}" : "{}:{}"), address,
                     endpoint.port());
}

class TcpListener : public Listener {
 public:
  TcpListener(asio::io_context& io, const NetConfig& config, OnSocket on_socket)
      : loop_(std::make_shared<AcceptLoop<tcp>>(
            listen(io, endpoint_of(config), config.log), config.log,
            [this, on_socket = std::move(on_socket)](tcp::socket socket) {
              prepare(socket);
              Peer peer = peer_of(socket, address_);
              on_socket(std::move(socket), std::move(peer));
            })),
        address_(describe(loop_->acceptor().local_endpoint())) {}

  void start() override { loop_->accept(); }
  void stop() override { loop_->stop(); }
  [[nodiscard]] const std::string& address() const override { return address_; }
  [[nodiscard]] std::uint16_t port() const override {
    return loop_->acceptor().local_endpoint().port();
  }

 private:
  std::shared_ptr<AcceptLoop<tcp>> loop_;
  std::string address_;
};

}  // namespace

std::shared_ptr<Listener> listen_tcp(asio::io_context& io, const NetConfig& config,
                                     OnSocket on_socket) {
  return std::make_shared<TcpListener>(io, config, std::move(on_socket));
}

}  // namespace dtact::net
