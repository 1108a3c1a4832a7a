#include "clients/web/server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "clients/web/names.hpp"
#include "clients/web/token_query.hpp"
#include "daemon/serve/security.hpp"
#include "proto/framing.hpp"

namespace dtact::web {

namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

/// A field of a request; empty where there is none.
template <typename Field>
std::string_view field(const Request& request, Field name) {
  const auto value = request[name];
  return {value.data(), value.size()};
}

/// Without what stands behind '?'.
std::string_view path_of(const Request& request) {
  const std::string_view target{request.target().data(), request.target().size()};
  return target.substr(0, target.find('?'));
}

Answer misdirected(const Request& request) {
  const std::string_view name = without_port(field(request, http::field::host));
  return refusal(
      http::status::misdirected_request,
      fmt::format("this gateway does not know itself by the name \"{}\": use its address or "
                  "localhost, or start it with --name {}",
                  name, name));
}

Answer refusal_of(const net::Admission::Verdict& verdict) {
  if (verdict.error_code != v1::ERROR_DENIED) {
    return refusal(http::status::service_unavailable, verdict.sentence);
  }
  Answer answer =
      refusal(http::status::unauthorized,
              verdict.sentence + ": it belongs into the connection's address, ?token=…");
  answer.delay = verdict.delay;
  return answer;
}

}  // namespace

Server::Server(asio::io_context& io, Settings settings, const Page& page)
    : config_(net::checked(std::move(settings.net))),
      host_names_(std::move(settings.host_names)),
      foxglove_origins_(std::move(settings.foxglove_origins)),
      page_(page),
      tls_(net::make_tls(config_)),
      admission_(config_) {
  std::vector<guided::Calibrated> calibrated;
  for (NamedDaemon& daemon : settings.daemons) {
    const client::Options options = daemon.options;
    auto source = std::make_shared<Source>(io, daemon.name, std::move(daemon.options));
    calibrated.push_back({source, options});
    sensors_.push_back(std::make_shared<Sensor>(io, std::move(source), config_, admission_));
  }
  foxglove_ = std::make_unique<foxglove::FoxgloveEndpoint>(sources(), config_, admission_);
  guided_ = std::make_unique<guided::GuidedEndpoint>(
      std::move(calibrated), std::move(settings.work_folder), config_, admission_);
  listener_ = net::listen_tcp(io, config_, [this](asio::ip::tcp::socket socket, net::Peer peer) {
    auto ticket = limits_.admit(peer.host);
    serve_http(std::move(socket), std::move(peer), tls_ ? &tls_->context : nullptr,
               weak_from_this(), std::move(ticket), config_.peer_timeout);
  });
}

void Server::start() {
  for (const auto& sensor : sensors_) {
    sensor->start();
    sensor->source().start();
  }
  foxglove_->start();
  listener_->start();
}

void Server::stop() {
  listener_->stop();
  foxglove_->stop();
  guided_->stop();
  for (const auto& sensor : sensors_) {
    sensor->stop();
    sensor->source().stop();
  }
}

std::string Server::address() const {
  return fmt::format("{}://{}/", tls_ ? "https" : "http", listener_->address());
}

bool Server::is_for_us(const Request& request) const {
  return is_own_host(field(request, http::field::host), host_names_);
}

Answer Server::answer(const Request& request) {
  if (!is_for_us(request)) return misdirected(request);
  const std::string_view path = path_of(request);
  if (path == "/sensors") return {.type = "application/json", .text = sensors()};
  if (const Page::File* file = page_.find(path)) {
    return {.type = file->type, .bytes = file->bytes, .tag = file->tag};
  }
  if (path == "/" && page_.empty()) {
    return refusal(http::status::not_found,
                   "this dtact-web was built without its page: build it with npm installed, or "
                   "start it with --page FOLDER");
  }
  return refusal(http::status::not_found, "there is nothing here");
}

Upgrade Server::upgrade(const Request& request, const net::Peer& peer) {
  if (!is_for_us(request)) return {.refusal = misdirected(request)};
  const std::string_view origin = field(request, http::field::origin);
  const std::string_view host = field(request, http::field::host);
  const bool foxglove = foxglove_->knows(path_of(request));
  const std::vector<std::string> others = foxglove ? foxglove_origins_ : std::vector<std::string>{};
  // Only browsers say one; other programs may do all that the token lets them do.
  if (!origin.empty() && !is_own_origin(origin, host, tls_ != nullptr, others)) {
    return {.refusal = refusal(http::status::forbidden,
                               fmt::format("a page of {} may not look at this sensor", origin))};
  }
  const bool guided = guided_->knows(path_of(request));
  if (foxglove || guided) {
    // Before there is a WebSocket: a refused one would hold a descriptor until it has read why.
    const std::string target(request.target().data(), request.target().size());
    const std::string token = token_of(target);
    const auto verdict = admission_.judge(peer, token);
    if (!verdict.rights) return {.refusal = refusal_of(verdict)};
    return foxglove ? foxglove_->upgrade(request) : guided_->upgrade(path_of(request), token);
  }
  const auto sensor = find(path_of(request));
  if (sensor == nullptr) {
    return {.refusal = refusal(http::status::not_found,
                               "there is no such sensor: GET /sensors lists those there are")};
  }
  return {.max_message = wire::kMaxMessage + wire::kLengthSize,
          .open = [sensor](std::shared_ptr<WebSocket> socket, net::Peer from) {
            sensor->admit(std::move(socket), std::move(from));
          }};
}

std::string Server::sensors() const {
  std::string text;
  for (const auto& sensor : sensors_) {
    text += text.empty() ? '[' : ',';
    text += sensor->entry();
  }
  return text + ']';
}

std::vector<std::shared_ptr<Source>> Server::sources() const {
  std::vector<std::shared_ptr<Source>> all;
  all.reserve(sensors_.size());
  for (const auto& sensor : sensors_) all.push_back(sensor->shared_source());
  return all;
}

/// "/sensors/NAME/wire"
std::shared_ptr<Sensor> Server::find(std::string_view path) const {
  constexpr std::string_view kBefore = "/sensors/";
  constexpr std::string_view kBehind = "/wire";
  if (!path.starts_with(kBefore) || !path.ends_with(kBehind)) return nullptr;
  path.remove_prefix(kBefore.size());
  path.remove_suffix(std::min(path.size(), kBehind.size()));
  const auto found =
      std::ranges::find_if(sensors_, [&](const auto& one) { return one->source().name() == path; });
  return found == sensors_.end() ? nullptr : *found;
}

}  // namespace dtact::web
