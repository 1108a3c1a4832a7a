#include "clients/web/foxglove/foxglove_endpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http/rfc7230.hpp>
#include <chrono>
#include <utility>

#include "clients/web/token_query.hpp"

namespace dtact::web::foxglove {

namespace http = boost::beast::http;

namespace {

/// The one of ours that a client offers; empty: none.
std::string subprotocol_of(const Request& request) {
  for (const auto& offered : http::token_list(request[http::field::sec_websocket_protocol])) {
    const std::string name(offered.data(), offered.size());
    if (name == kSubprotocol || name == kSdkSubprotocol) return name;
  }
  return "";
}

/// How long who is refused may take to read why.
constexpr std::chrono::seconds kLinger{2};

/// Says why, as the protocol does, and ends.
void refuse(const std::shared_ptr<WebSocket>& socket, const std::string& sentence) {
  const auto timer = std::make_shared<boost::asio::steady_timer>(socket->executor(), kLinger);
  timer->async_wait([timer, socket](const boost::system::error_code&) { socket->close(); });
  const auto text = std::make_shared<const std::string>(status(2, sentence));
  socket->write({boost::asio::buffer(*text)}, true,
                [socket, text](const boost::system::error_code& error, std::size_t) {
                  if (!error) socket->end(socket);
                });
}

}  // namespace

FoxgloveEndpoint::FoxgloveEndpoint(const std::vector<std::shared_ptr<Source>>& sources, bool find,
                                   const net::NetConfig& config, net::Admission& admission)
    : find_(find), config_(config), admission_(admission) {
  sensors_.reserve(sources.size());
  for (const auto& source : sources) sensors_.push_back(std::make_shared<SensorTopics>(source));
}

void FoxgloveEndpoint::start() {
  for (const auto& sensor : sensors_) sensor->start();
}

void FoxgloveEndpoint::add(std::shared_ptr<Source> source) {
  sensors_.push_back(std::make_shared<SensorTopics>(std::move(source)));
  const auto& sensor = sensors_.back();
  sensor->start();
  for (const Client& one : clients_) {
    const auto client = one.all ? one.client.lock() : nullptr;
    if (client != nullptr) client->add({sensor, "/" + sensor->source().name()});
  }
}

void FoxgloveEndpoint::stop() {
  for (const Client& one : std::exchange(clients_, {})) {
    if (const auto client = one.client.lock()) client->close("dtact-web ends");
  }
  for (const auto& sensor : sensors_) sensor->stop();
}

void FoxgloveEndpoint::end_revoked() {
  const auto clients = clients_;
  for (const Client& one : clients) {
    const auto client = one.client.lock();
    if (client == nullptr || admission_.still_allows(client->grant())) continue;
    client->close("its token was revoked, or given other rights");
  }
}

std::vector<Mount> FoxgloveEndpoint::mounts(std::string_view path) const {
  std::vector<Mount> found;
  for (const auto& sensor : sensors_) {
    const std::string& name = sensor->source().name();
    const bool own = path == fmt::format("/sensors/{}/foxglove", name);
    // One sensor's topics are called as in a recording of it.
    const bool alone = own || (sensors_.size() == 1 && !find_);
    if (own || path == kAll) found.push_back({sensor, alone ? "" : "/" + name});
  }
  return found;
}

Upgrade FoxgloveEndpoint::upgrade(const Request& request) {
  const std::string target(request.target().data(), request.target().size());
  const std::string subprotocol = subprotocol_of(request);
  if (subprotocol.empty()) {
    return {.refusal = {.status = http::status::bad_request,
                        .text = fmt::format("offer the subprotocol {} or {}", kSubprotocol,
                                            kSdkSubprotocol)}};
  }
  return {
      .subprotocol = subprotocol,
      .max_message = kMaxMessage,
      .open = [this, path = target.substr(0, target.find('?')), token = token_of(target)](
                  std::shared_ptr<WebSocket> socket, const net::Peer& peer,
                  const std::shared_ptr<void>&) { admit(std::move(socket), peer, token, path); }};
}

void FoxgloveEndpoint::admit(std::shared_ptr<WebSocket> socket, const net::Peer& peer,
                             const std::string& token, std::string_view path) {
  const auto verdict = admission_.enter(peer, token);
  if (!verdict.grant) {
    config_.log({net::LogLevel::warning,
                 fmt::format("Foxglove's client {}: {}", peer.address, verdict.sentence),
                 peer.address, net::LogSubject::unauthenticated});
    return refuse(socket, token.empty()
                              ? verdict.sentence + ": add ?token=… to the address of the connection"
                              : verdict.sentence);
  }
  const std::string& name = verdict.grant->name;
  config_.log({net::LogLevel::info,
               fmt::format("Foxglove's client {} connected{}{}", peer.address,
                           name.empty() ? "" : " as ", name),
               peer.address, net::LogSubject::general, name});
  const auto ended = [this, peer, name](const std::string& reason) {
    admission_.leave(peer);
    config_.log({net::LogLevel::info,
                 fmt::format("Foxglove's client {} disconnected: {}", peer.address, reason),
                 peer.address, net::LogSubject::general, name});
  };
  const std::string identity =
      fmt::format("{} (Foxglove{}{})", peer.address, name.empty() ? "" : ", token ", name);
  const auto client = std::make_shared<FoxgloveClient>(
      std::move(socket), mounts(path), *verdict.grant, identity, config_.program, ended);
  std::erase_if(clients_, [](const Client& one) { return one.client.expired(); });
  clients_.push_back({client, path == kAll});
  client->start();
}

}  // namespace dtact::web::foxglove
