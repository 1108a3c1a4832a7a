#include "clients/perceive/server.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

#include "clients/cpp/errors.hpp"
#include "clients/perceive/upstream_subscription.hpp"
#include "daemon/serve/client_status.hpp"
#include "hal/base/clock.hpp"

namespace dtact::perceive {

namespace asio = boost::asio;
using net::Subscription;

Server::Server(asio::io_context& io, net::NetConfig config, client::Options daemon,
               const std::shared_ptr<const ObjectModel>& object,
               const std::filesystem::path& taught)
    : io_(io),
      listeners_(io, std::move(config)),
      maker_(object, taught),
      daemon_(std::move(daemon)) {}

void Server::start() {
  const auto weak = weak_from_this();
  listeners_.open(weak, [this](const auto& session) { session_list_.admit(session); });
  const auto frame = [weak, &io = io_] {
    asio::post(io, [weak] {
      if (const auto self = weak.lock()) self->on_frame();
    });
  };
  const auto notice = [weak, &io = io_](const std::string& sentence) {
    asio::post(io, [weak, sentence] {
      if (const auto self = weak.lock()) {
        self->listeners_.config().log({net::LogLevel::info, sentence});
      }
    });
  };
  upstream_ = std::make_unique<Upstream>(daemon_, Upstream::Handlers{frame, notice});
  update_want();
}

void Server::stop() {
  listeners_.close();
  session_list_.dismiss("dtact-perceive ends");
  upstream_.reset();
}

void Server::reload() {
  listeners_.reload(net::NetConfig(listeners_.config()));
  session_list_.end_revoked();
}

void Server::introduce(v1::HelloReply& reply) const {
  const v1::HelloReply known = daemon();
  reply.set_name(known.name());
  reply.set_serial(known.serial());
  if (known.has_surface_frame()) *reply.mutable_surface_frame() = known.surface_frame();
}

v1::HelloReply Server::daemon() const { return upstream_ ? upstream_->daemon() : v1::HelloReply(); }

void Server::on_frame() {
  if (!upstream_) return;
  auto taken = upstream_->take();
  if (!taken) return;
  ++frames_;
  skipped_ += taken->missed;
  const std::int64_t timestamp_ns = taken->frame.monotonic_ns();
  if (taken->parted) maker_.release();
  try {
    maker_.begin(std::move(taken->frame), extras_);
  } catch (const client::ProtocolError& e) {
    // Once, not with each frame.
    if (std::exchange(damage_, e.what()) != e.what()) {
      listeners_.config().log({net::LogLevel::warning, damage_});
    }
    return;
  }
  damage_.clear();
  for (const auto& session : session_list_.all()) {
    const auto kind = session->due(timestamp_ns, taken->missed);
    if (!kind) continue;
    if (auto encoded = maker_.make(*kind)) session->send_frame(std::move(encoded));
  }
  const bool in_contact = maker_.frame().contact().in_contact();
  if (in_contact == in_contact_ && maker_.mm_per_px() == mm_per_px_) return;
  in_contact_ = in_contact;
  mm_per_px_ = maker_.mm_per_px();
  update_want();
}

void Server::update_want() {
  UpstreamSubscription demand(in_contact_, mm_per_px_);
  for (const auto& session : session_list_.all()) {
    if (session->ready()) demand.add(session->subscription());
  }
  extras_ = {.pose = demand.pose(), .recognition = demand.recognition()};
  const v1::Subscribe wanted = demand.subscription();
  // Without frames the end of a contact is not seen: the next one may be another object's.
  if (!wanted.summary()) {
    maker_.release();
    damage_.clear();  // nor is it seen when frames can be read again
  }
  if (upstream_ == nullptr || wanted.SerializeAsString() == wanted_.SerializeAsString()) return;
  wanted_ = wanted;
  upstream_->want(wanted);
}

void Server::subscribe(const std::shared_ptr<net::Session>& session, std::uint64_t id,
                       const v1::Subscribe& request) {
  const auto made = Subscription::from(request, {}, net::Serves::geometry);
  if (const auto* refusal = std::get_if<net::Refusal>(&made)) {
    return session->reply_error(id, refusal->code, refusal->sentence);
  }
  session->subscribe(std::get<Subscription>(made));
  update_want();
  v1::ServerMessage message;
  message.mutable_reply()->set_id(id);
  message.mutable_reply()->mutable_done();
  session->send(message);
}

void Server::on_request(const std::shared_ptr<net::Session>& session,
                        const v1::ClientMessage& message) {
  v1::ServerMessage answer;
  answer.mutable_reply()->set_id(message.id());
  switch (message.request_case()) {
    case v1::ClientMessage::kSubscribe:
      return subscribe(session, message.id(), message.subscribe());
    case v1::ClientMessage::kGetStatus:
      fill(*answer.mutable_reply()->mutable_status());
      return session->send(answer);
    case v1::ClientMessage::kPing: {
      auto& pong = *answer.mutable_reply()->mutable_pong();
      pong.set_monotonic_ns(base::system_clock().monotonic_ns());
      pong.set_wall_ns(base::system_clock().wall_ns());
      return session->send(answer, true);
    }
    default:
      return session->reply_error(message.id(), v1::ERROR_UNSUPPORTED,
                                  "dtact-perceive answers Subscribe, GetStatus and Ping alone: ask "
                                  "dtactd itself for everything else");
  }
}

void Server::fill(v1::Status& status) const {
  const v1::HelloReply known = daemon();
  const std::string away = upstream_ ? upstream_->away() : "";
  status.set_advice(away.empty() ? damage_ : away);
  status.set_state(status.advice().empty() ? v1::STATE_SERVING : v1::STATE_UNSPECIFIED);
  status.set_version(listeners_.config().version);
  status.set_name(known.name());
  status.set_serial(known.serial());
  status.set_frames(frames_);
  status.set_skipped(skipped_);
  const std::chrono::duration<double> uptime = std::chrono::steady_clock::now() - start_;
  status.set_uptime_s(uptime.count());
  for (const auto& endpoint : listeners_.endpoints()) net::fill(endpoint, *status.add_endpoints());
  for (const auto& session : session_list_.all()) {
    if (session->ready()) net::fill(*session, *status.add_clients());
  }
}

void Server::on_closed(const net::Session& session) {
  // Later, since a session may end while the list is being walked through.
  asio::post(io_, [weak = weak_from_this(), gone = &session] {
    const auto self = weak.lock();
    if (self == nullptr) return;
    (void)self->session_list_.release(gone);
    self->update_want();
  });
}

}  // namespace dtact::perceive
