#include "daemon/serve/listeners.hpp"

#include <optional>
#include <stdexcept>
#include <utility>

namespace dtact::net {

Listeners::Listeners(boost::asio::io_context& io, NetConfig settings)
    : config_(checked(std::move(settings))),
      tls_(make_tls(config_)),
      certificate_watch_(io, config_, tls_),
      admission_(config_) {
  const auto admit = [this](std::unique_ptr<Transport> transport) {
    admit_(std::make_shared<Session>(std::move(transport), config_, admission_, host_));
  };
  const bool token = !config_.token_file.empty();
  if (!config_.unix_socket.empty()) {
    listeners_.push_back(listen_unix(io, config_, admit));
    endpoints_.push_back({listeners_.back()->address(), false, token, false, ""});
  }
  if (!config_.address.empty()) {
    listeners_.push_back(
        listen_tcp(io, config_, [this, admit](boost::asio::ip::tcp::socket socket, Peer peer) {
          if (tls_ && !admission_.take_handshake(peer)) return;
          admit(over_tcp(std::move(socket), std::move(peer), config_.peer_timeout,
                         tls_ ? &tls_->context : nullptr));
        }));
    endpoints_.push_back({listeners_.back()->address(), tls_ != nullptr, token,
                          is_insecure(config_), tls_ ? tls_->fingerprint : ""});
    if (tls_) endpoints_.back().certificate_expires = tls_->expires;
  }
  if (listeners_.empty()) {
    throw std::runtime_error(
        "there is neither an address nor a Unix socket to listen on, so that nobody could connect: "
        "set one");
  }
}

void Listeners::open(std::weak_ptr<SessionHost> host,
                     std::function<void(const std::shared_ptr<Session>&)> admit) {
  host_ = std::move(host);
  admit_ = std::move(admit);
  for (const auto& listener : listeners_) listener->start();
  certificate_watch_.check();
}

void Listeners::close() {
  for (const auto& listener : listeners_) listener->stop();
  certificate_watch_.stop();
}

void Listeners::reload(const NetConfig& fresh) {
  std::unique_ptr<Tls> new_tls = make_tls(fresh);
  std::optional<Tokens> new_tokens = read_tokens(fresh);
  // From here on nothing fails. Neither TLS nor tokens end without a restart.
  if (tls_ && new_tls) {
    config_.tls_certificate = fresh.tls_certificate;
    *tls_ = std::move(*new_tls);  // where it is, since the listener knows its place
    for (EndpointInfo& endpoint : endpoints_) {
      if (!endpoint.tls) continue;
      endpoint.fingerprint = tls_->fingerprint;
      endpoint.certificate_expires = tls_->expires;
    }
  }
  if (new_tokens) admission_.set_tokens(std::move(new_tokens));
  certificate_watch_.check();
  config_.max_clients = fresh.max_clients;
  config_.max_clients_per_address = fresh.max_clients_per_address;
  config_.max_requests_per_s = fresh.max_requests_per_s;
  config_.hello_timeout = fresh.hello_timeout;
}

std::vector<std::string> Listeners::addresses() const {
  std::vector<std::string> all;
  all.reserve(listeners_.size());
  for (const auto& listener : listeners_) all.push_back(listener->address());
  return all;
}

std::uint16_t Listeners::port() const { return listeners_.back()->port(); }

}  // namespace dtact::net
