#include "daemon/net/server.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>
#include <stdexcept>
#include <utility>

#include "daemon/net/admission.hpp"
#include "daemon/net/commands.hpp"
#include "daemon/net/hub.hpp"
#include "daemon/net/limited_log.hpp"
#include "daemon/net/listener.hpp"
#include "daemon/net/security.hpp"
#include "daemon/net/tls.hpp"

namespace dtact::net {

namespace {

std::unique_ptr<Tls> make_tls(const NetConfig& config) {
  if (config.tls_certificate.empty()) return nullptr;
  return std::make_unique<Tls>(config.tls_certificate, config.tls_key);
}

NetConfig checked(NetConfig config) {
  check_security(config);
  if (is_insecure(config)) {
    config.log(
        {LogLevel::warning,
         fmt::format("net.insecure: whoever can reach {} may {} the sensor, since there is no "
                     "{}",
                     config.address, config.token_file.empty() ? "watch and command" : "watch",
                     config.token_file.empty() ? "token" : "TLS to keep a token secret")});
  }
  config.log = limited(std::move(config.log));
  return config;
}

}  // namespace

struct Server::Impl {
  Impl(boost::asio::io_context& io, NetConfig settings, pipeline::Port& port,
       CalibrationStore& store)
      : config(checked(std::move(settings))),
        tls(make_tls(config)),
        admission(config),
        worker(1),
        hub(std::make_shared<Hub>(io, config, port)),
        commands(std::make_shared<Commands>(io, worker, config, *hub, port, store)) {
    const auto admit = [this](std::unique_ptr<Transport> transport) {
      hub->admit(std::make_shared<Session>(std::move(transport), config, admission, hub));
    };
    const bool token = !config.token_file.empty();
    std::vector<EndpointInfo> endpoints;
    if (!config.unix_socket.empty()) {
      listeners.push_back(listen_unix(io, config, admit));
      endpoints.push_back({listeners.back()->address(), false, token, false, ""});
    }
    if (!config.address.empty()) {
      listeners.push_back(listen_tcp(io, config, tls ? &tls->context : nullptr, admit));
      endpoints.push_back({listeners.back()->address(), tls != nullptr, token, is_insecure(config),
                           tls ? tls->fingerprint : ""});
    }
    if (listeners.empty()) {
      throw std::runtime_error(
          "net.address and net.unix_socket are empty, so that nobody could connect: set one");
    }
    hub->set_endpoints(std::move(endpoints));
  }

  void reload(const NetConfig& fresh) {
    std::unique_ptr<Tls> new_tls = make_tls(fresh);
    std::optional<Tokens> new_tokens = read_tokens(fresh);
    // From here on nothing fails.
    if (tls && new_tls) {
      *tls = std::move(*new_tls);  // where it is, since the listener knows its place
      std::vector<EndpointInfo> endpoints = hub->endpoints();
      endpoints.back().fingerprint = tls->fingerprint;  // TCP is the last
      hub->set_endpoints(std::move(endpoints));
    }
    admission.set_tokens(std::move(new_tokens));
    config.max_clients = fresh.max_clients;
    config.max_clients_per_address = fresh.max_clients_per_address;
    config.max_requests_per_s = fresh.max_requests_per_s;
    config.hello_timeout = fresh.hello_timeout;
  }

  NetConfig config;
  std::unique_ptr<Tls> tls;
  Admission admission;
  boost::asio::thread_pool worker;
  std::shared_ptr<Hub> hub;
  std::shared_ptr<Commands> commands;
  std::vector<std::shared_ptr<Listener>> listeners;
};

Server::Server(boost::asio::io_context& io, NetConfig config, pipeline::Port& port,
               CalibrationStore& store)
    : impl_(std::make_unique<Impl>(io, std::move(config), port, store)) {
  auto& commands = *impl_->commands;
  impl_->hub->start(
      {[&commands](const std::shared_ptr<Session>& session, const v1::ClientMessage& message) {
         commands.on_request(session, message);
       },
       [&commands](const pipeline::CommandDone& done) { commands.on_done(done); },
       [&commands](const hal::Light& light) { commands.on_light(light); }});
  for (const auto& listener : impl_->listeners) listener->start();
}

Server::~Server() { stop(); }

Overview Server::overview() const { return impl_->commands->overview(); }

std::vector<std::string> Server::addresses() const {
  std::vector<std::string> all;
  for (const auto& listener : impl_->listeners) all.push_back(listener->address());
  return all;
}

void Server::reload(const NetConfig& fresh) { impl_->reload(fresh); }

std::uint16_t Server::port() const { return impl_->listeners.back()->port(); }

void Server::stop() {
  for (const auto& listener : impl_->listeners) listener->stop();
  impl_->hub->stop();
}

}  // namespace dtact::net
