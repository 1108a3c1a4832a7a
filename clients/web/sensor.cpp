#include "clients/web/sensor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <cmath>
#include <utility>

#include "clients/common/json.hpp"
#include "clients/cpp/names.hpp"
#include "daemon/serve/subscription.hpp"
#include "version.hpp"

namespace dtact::web {

namespace asio = boost::asio;
using net::Subscription;

namespace {

void send(net::Session& session, std::uint64_t id, v1::Reply reply) {
  v1::ServerMessage message;
  *message.mutable_reply() = std::move(reply);
  message.mutable_reply()->set_id(id);
  session.send(message);
}

/// What /fleet says of a status, which has more.
std::string json_of(const v1::Status& status) {
  std::string health;
  for (const std::string& flag : client::names_of(status.health())) {
    health += (health.empty() ? "" : ",") + cli::json_string(flag);
  }
  return fmt::format(R"({{"state":{},"fps":{:.1f},"version":{},"health":[{}],"advice":{}}})",
                     cli::json_string(client::name_of(status.state())),
                     std::isfinite(status.fps()) ? status.fps() : 0,
                     cli::json_string(status.version()), health, cli::json_string(status.advice()));
}

/// All that the daemon lets through, since rates were its part.
Subscription every_frame(v1::Subscribe request) {
  for (const auto clear : {&v1::Subscribe::clear_every, &v1::Subscribe::clear_depth_hz,
                           &v1::Subscribe::clear_luma_hz, &v1::Subscribe::clear_jpeg_hz,
                           &v1::Subscribe::clear_summary_hz, &v1::Subscribe::clear_cloud_hz,
                           &v1::Subscribe::clear_pose_hz, &v1::Subscribe::clear_recognition_hz}) {
    (request.*clear)();
  }
  auto made = Subscription::from(request, {}, net::Serves::everything);
  // The daemon has agreed to it; one that knows more than this release sends more.
  const auto* subscription = std::get_if<Subscription>(&made);
  return subscription != nullptr ? *subscription : Subscription();
}

}  // namespace

Sensor::Sensor(asio::io_context& io, std::shared_ptr<Source> source, const net::NetConfig& config,
               net::Admission& admission)
    : io_(io), source_(std::move(source)), config_(config), admission_(admission) {}

void Sensor::start() {
  source_->follow(this, {.changed = [this] { on_changed(); },
                         .event = [this](const auto& event) { session_list_.broadcast(event); }});
}

void Sensor::stop() {
  source_->unfollow(this);
  for (const auto& session : session_list_.all()) source_->leave(session.get());
  viewers_.clear();
  session_list_.dismiss("dtact-web ends");
}

void Sensor::admit(std::shared_ptr<WebSocket> socket, net::Peer peer, std::shared_ptr<void> place) {
  auto transport =
      std::make_unique<WireTransport>(std::move(socket), std::move(peer), std::move(place));
  WireTransport* const there = transport.get();
  const auto session =
      std::make_shared<net::Session>(std::move(transport), config_, admission_, weak_from_this());
  viewers_[session.get()].transport = there;
  session_list_.admit(session);
  there->send_text(entry());
}

std::string Sensor::entry() const {
  std::string text = fmt::format(R"({{"name":{},"connected":{})", cli::json_string(source_->name()),
                                 source_->connected());
  if (!source_->connected()) {
    // Clients without a token must not learn addresses.
    const std::string error = config_.token_file.empty()
                                  ? source_->reason()
                                  : "its daemon is away: dtact-web's log says why";
    text += fmt::format(R"(,"error":{})", cli::json_string(error));
  }
  return text + "}";
}

std::string Sensor::entry_with_status(std::chrono::steady_clock::time_point now) const {
  std::string text = entry();
  const bool known = !status_.empty() && now < status_came_ + kMaxStatusAge;
  if (known) text.insert(text.size() - 1, ",\"status\":" + status_);
  return text;
}

void Sensor::ask_status() {
  const auto now = std::chrono::steady_clock::now();
  if (!source_->connected() || now < status_asked_ + std::chrono::seconds(1)) return;
  status_asked_ = now;
  v1::ClientMessage message;
  message.mutable_get_status();
  source_->request(std::move(message), config_.program,
                   [weak = weak_from_this()](const v1::Reply& reply) {
                     const auto self = weak.lock();
                     if (self != nullptr && reply.has_status()) {
                       self->status_ = json_of(reply.status());
                       self->status_came_ = std::chrono::steady_clock::now();
                     }
                   });
}

void Sensor::on_changed() {
  status_.clear();
  const auto& daemon = source_->daemon();
  const bool there = daemon && source_->connected();
  config_.log(
      {there ? net::LogLevel::info : net::LogLevel::warning,
       fmt::format("the daemon of {} {}", source_->name(),
                   there ? "is there: " + daemon->program() : "is away: " + source_->reason())});
  const std::string text = entry();
  for (const auto& session : session_list_.all()) {
    if (!source_->connected()) session->subscribe(Subscription());
    viewers_[session.get()].transport->send_text(text);
  }
}

void Sensor::introduce(v1::HelloReply& reply) const {
  const auto& daemon = source_->daemon();
  if (!daemon) return;
  reply.set_program(fmt::format("{} by {}", daemon->program(), config_.program));
  *reply.mutable_features() = daemon->features();
  *reply.mutable_surface_frame() = daemon->surface_frame();
  reply.set_name(daemon->name());
  reply.set_serial(daemon->serial());
  reply.set_instance(daemon->instance());
  reply.set_rezero_timeout_s(daemon->rezero_timeout_s());
  reply.set_rights(std::min(reply.rights(), daemon->rights()));
}

void Sensor::on_request(const std::shared_ptr<net::Session>& session,
                        const v1::ClientMessage& message) {
  if (!viewers_[session.get()].requests.take(1)) {
    return session->reply_error(
        message.id(), v1::ERROR_BUSY,
        fmt::format("this viewer asks more than {:g} times a second: ask again later",
                    kMaxRequestsPerS));
  }
  if (message.has_subscribe()) return subscribe(session, message.id(), message.subscribe());
  source_->request(message, session->identity(),
                   [weak = std::weak_ptr(session), id = message.id()](v1::Reply reply) {
                     if (const auto viewer = weak.lock()) send(*viewer, id, std::move(reply));
                   });
}

void Sensor::subscribe(const std::shared_ptr<net::Session>& session, std::uint64_t id,
                       const v1::Subscribe& request) {
  const std::uint64_t number = ++viewers_[session.get()].asked;
  const auto answered = [this, weak = std::weak_ptr(session), id, request,
                         number](v1::Reply reply) {
    const auto viewer = weak.lock();
    if (viewer == nullptr) return;
    const auto known = viewers_.find(viewer.get());
    if (known != viewers_.end() && !reply.has_error() && number > known->second.accepted) {
      known->second.accepted = number;
      viewer->subscribe(every_frame(request));
    }
    send(*viewer, id, std::move(reply));
  };
  source_->subscribe(
      {.who = session.get(),
       .owner =
           session->token_name().empty() ? session->peer().host : "token " + session->token_name(),
       .may_control = session->rights() >= net::Rights::control},
      request, answered,
      [this, session = session.get()](const RelayedFrame& frame, std::uint64_t missed) {
        on_frame(*session, frame, missed);
      });
}

void Sensor::on_frame(net::Session& session, const RelayedFrame& frame, std::uint64_t missed) {
  const auto viewer = viewers_.find(&session);
  if (viewer == viewers_.end()) return;
  std::uint32_t& waiting = viewer->second.waiting;
  const bool waits = session.outbox().frame_waits();
  // A picture that comes seldom is not lost to the many frames without one.
  const bool keeps = waits && (waiting & ~frame.parts) != 0;
  if (!session.due(frame.monotonic_ns, keeps ? missed + 1 : missed) || keeps) return;
  waiting = frame.parts;
  session.send_frame(frame.encoded);
}

void Sensor::on_closed(const net::Session& session) {
  // Later, since a session may end while the list is being walked through.
  asio::post(io_, [weak = weak_from_this(), gone = &session] {
    const auto self = weak.lock();
    if (self == nullptr || self->viewers_.erase(gone) == 0) return;
    self->source_->leave(gone);
    (void)self->session_list_.release(gone);
  });
}

}  // namespace dtact::web
