#include "clients/perceive/upstream.hpp"

#include <stdexcept>
#include <utility>

namespace dtact::perceive {
namespace {

constexpr std::uint64_t kSubscribeId = 2;  // Hello's is 1

}  // namespace

Upstream::Upstream(client::Options options, Handlers handlers)
    : handlers_(std::move(handlers)),
      host_(options.host),
      link_(std::move(options),
            {.up = [this](v1::HelloReply daemon,
                          bool same_machine) { on_up(std::move(daemon), same_machine); },
             .down = [this](const std::string& reason) { on_down(reason); },
             .message = [this](const std::string& bytes) { on_message(bytes); }}) {}

void Upstream::want(const v1::Subscribe& subscription) {
  const std::lock_guard lock(mutex_);
  wanted_ = subscription;
  subscribe();
}

std::optional<NewestFrame::Taken> Upstream::take() {
  const std::lock_guard lock(mutex_);
  return newest_.take();
}

v1::HelloReply Upstream::daemon() const {
  const std::lock_guard lock(mutex_);
  return daemon_;
}

std::string Upstream::away() const {
  const std::lock_guard lock(mutex_);
  return away_;
}

void Upstream::on_up(v1::HelloReply daemon, bool same_machine) {
  const std::string program = daemon.program();
  {
    const std::lock_guard lock(mutex_);
    daemon_ = std::move(daemon);
    away_.clear();
    newest_.part();
    // Raw values cost least where they need not travel.
    compressed_ = !same_machine;
    subscribe();
  }
  handlers_.notice("connected to " + program + " at " + host_);
}

void Upstream::on_down(const std::string& reason) {
  {
    const std::lock_guard lock(mutex_);
    away_ = reason;
  }
  handlers_.notice(reason);
}

/// Under the mutex, so that what is wanted last is said last. Lost while the daemon is away:
/// on_up() says it again.
void Upstream::subscribe() {
  v1::ClientMessage message;
  message.set_id(kSubscribeId);
  *message.mutable_subscribe() = wanted_;
  if (compressed_ && wanted_.depth() != v1::DEPTH_NONE) {
    message.mutable_subscribe()->set_depth(v1::DEPTH_PREDICT_ZSTD);
  }
  link_.send(message.SerializeAsString());
}

void Upstream::on_message(const std::string& bytes) {
  v1::ServerMessage message;
  if (!message.ParseFromString(bytes)) {
    throw std::runtime_error(host_ + " sends what is no message of the wire");
  }
  if (message.reply().has_error()) return handlers_.notice(message.reply().error().message());
  if (!message.has_frame()) return;
  {
    const std::lock_guard lock(mutex_);
    newest_.put(std::move(*message.mutable_frame()));
  }
  handlers_.frame();
}

}  // namespace dtact::perceive
