#include "clients/web/server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "clients/web/names.hpp"
#include "clients/web/token_query.hpp"
#include "daemon/serve/security.hpp"
#include "hal/base/utf8.hpp"
#include "proto/framing.hpp"

namespace dtact::web {

namespace asio = boost::asio;
namespace http = boost::beast::http;

namespace {

/// Bytes of a name that an unauthenticated client chose that are logged.
constexpr std::size_t kMaxShown = 256;
/// The origin of programs on the desktop: Foxglove's and Lichtblick's.
constexpr const char* kDesktop = "file://";

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
    : io_(io),
      config_(net::checked(std::move(settings.net))),
      host_names_(std::move(settings.host_names)),
      foxglove_origins_(std::move(settings.foxglove_origins)),
      page_(page),
      tls_(net::make_tls(config_)),
      certificate_watch_(io, config_, tls_),
      admission_(config_) {
  foxglove_origins_.emplace_back(kDesktop);
  for (cli::NamedDaemon& daemon : settings.daemons) {
    auto source = std::make_shared<Source>(io, daemon.name, std::move(daemon.options));
    sensors_.push_back(std::make_shared<Sensor>(io, std::move(source), config_, admission_));
  }
  foxglove_ =
      std::make_unique<foxglove::FoxgloveEndpoint>(sources(), settings.find, config_, admission_);
  guided_ = std::make_unique<guided::GuidedEndpoint>(
      sources(), std::move(settings.work_folder), std::move(settings.taught), config_, admission_);
  listener_ = net::listen_tcp(io, config_, [this](asio::ip::tcp::socket socket, net::Peer peer) {
    if (tls_ && !admission_.take_handshake(peer)) return;
    auto ticket = limits_.admit(peer.host);
    serve_http(std::move(socket), std::move(peer), tls_ ? &tls_->context : nullptr,
               weak_from_this(), std::move(ticket), config_.peer_timeout);
  });
}

void Server::start() {
  for (const auto& sensor : sensors_) {
    sensor->start();
    sensor->source()->start();
  }
  foxglove_->start();
  listener_->start();
  certificate_watch_.check();
}

void Server::add(const cli::Finder::Found& found) {
  const cli::NamedDaemon& daemon = found.daemon;
  const auto known = std::ranges::find_if(
      sensors_, [&](const auto& one) { return one->source()->name() == daemon.name; });
  if (known != sensors_.end()) {
    config_.log({net::LogLevel::info, fmt::format("{} is at {}:{} now", daemon.name,
                                                  daemon.options.host, daemon.options.port)});
    return (*known)->source()->use(daemon.options);
  }
  config_.log({net::LogLevel::info, found.refused.empty()
                                        ? fmt::format("found {} at {}:{}", daemon.name,
                                                      daemon.options.host, daemon.options.port)
                                        : found.refused});
  auto source = std::make_shared<Source>(io_, daemon.name, daemon.options, found.refused);
  try {
    // First, since it may fail: any machine in the network can announce more daemons than this
    // program has threads and descriptors.
    source->start();
  } catch (const std::exception& e) {
    return config_.log(
        {net::LogLevel::warning, fmt::format("{} is left out: {}", daemon.name, e.what())});
  }
  guided_->add(source);
  foxglove_->add(source);
  sensors_.push_back(std::make_shared<Sensor>(io_, std::move(source), config_, admission_));
  sensors_.back()->start();
}

void Server::reload() {
  std::unique_ptr<net::Tls> tls = net::make_tls(config_);
  std::optional<net::Tokens> tokens = net::read_tokens(config_);
  // From here on nothing fails.
  if (tls_ && tls) *tls_ = std::move(*tls);  // where it is, since connections know its place
  certificate_watch_.check();
  admission_.set_tokens(std::move(tokens));
  for (const auto& sensor : sensors_) sensor->end_revoked();
  foxglove_->end_revoked();
  guided_->end_revoked();
}

void Server::stop() {
  listener_->stop();
  certificate_watch_.stop();
  foxglove_->stop();
  guided_->stop();
  for (const auto& sensor : sensors_) {
    sensor->stop();
    sensor->source()->stop();
  }
}

std::string Server::address() const {
  return fmt::format("{}://{}/", tls_ ? "https" : "http", listener_->address());
}

bool Server::is_for_us(const Request& request) const {
  return is_own_host(field(request, http::field::host), host_names_);
}

Answer Server::answer(const Request& request, const net::Peer& peer) {
  if (!is_for_us(request)) return misdirected(request);
  const std::string_view path = path_of(request);
  if (path == "/sensors") return {.type = "application/json", .text = sensors()};
  if (path == "/fleet") return fleet(request, peer);
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
    const std::string shown = base::printable(base::first_bytes(std::string(origin), kMaxShown));
    std::string sentence = fmt::format("a page of {} may not look at this sensor", shown);
    if (foxglove) sentence += fmt::format(": start dtact-web with --foxglove-origin {}", shown);
    config_.log({net::LogLevel::warning, sentence, "", net::LogSubject::unauthenticated});
    return {.refusal = refusal(http::status::forbidden, sentence)};
  }
  const bool guided = guided_->knows(path_of(request));
  if (foxglove || guided) {
    // Before there is a WebSocket: a refused one would hold a descriptor until it has read why.
    const std::string target(request.target().data(), request.target().size());
    const std::string token = token_of(target);
    const auto verdict = admission_.judge(peer, token);
    if (!verdict.grant) return {.refusal = refusal_of(verdict)};
    return foxglove ? foxglove_->upgrade(request) : guided_->upgrade(path_of(request), token);
  }
  const auto sensor = find(path_of(request));
  if (sensor == nullptr) {
    return {.refusal = refusal(http::status::not_found,
                               "there is no such sensor: GET /sensors lists those there are")};
  }
  return {.max_message = wire::kMaxMessage + wire::kLengthSize,
          .open = [sensor](std::shared_ptr<WebSocket> socket, net::Peer from,
                           std::shared_ptr<void> place) {
            sensor->admit(std::move(socket), std::move(from), std::move(place));
          }};
}

std::string Server::sensors() const {
  std::string text;
  for (const auto& sensor : sensors_) {
    text += text.empty() ? '[' : ',';
    text += sensor->entry();
  }
  return (text.empty() ? "[" : text) + ']';
}

/// Who asks comes again for what the daemons answer now.
Answer Server::fleet(const Request& request, const net::Peer& peer) {
  const std::string target(request.target().data(), request.target().size());
  const auto verdict = admission_.judge(peer, token_of(target));
  if (!verdict.grant) return refusal_of(verdict);
  std::string text;
  for (const auto& sensor : sensors_) {
    text += text.empty() ? '[' : ',';
    text += sensor->entry_with_status();
    sensor->ask_status();
  }
  return {.type = "application/json", .text = (text.empty() ? "[" : text) + "]"};
}

std::vector<std::shared_ptr<Source>> Server::sources() const {
  std::vector<std::shared_ptr<Source>> all;
  all.reserve(sensors_.size());
  for (const auto& sensor : sensors_) all.push_back(sensor->source());
  return all;
}

/// "/sensors/NAME/wire"
std::shared_ptr<Sensor> Server::find(std::string_view path) const {
  constexpr std::string_view kBefore = "/sensors/";
  constexpr std::string_view kBehind = "/wire";
  if (!path.starts_with(kBefore) || !path.ends_with(kBehind)) return nullptr;
  path.remove_prefix(kBefore.size());
  path.remove_suffix(std::min(path.size(), kBehind.size()));
  const auto found = std::ranges::find_if(
      sensors_, [&](const auto& one) { return one->source()->name() == path; });
  return found == sensors_.end() ? nullptr : *found;
}

}  // namespace dtact::web
