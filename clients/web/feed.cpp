#include "clients/web/feed.hpp"

#include <algorithm>
#include <utility>

namespace dtact::web {
namespace {

constexpr std::uint64_t kSubscribeId = 2;

std::string serialized(const v1::Subscribe& subscription) {
  v1::ClientMessage message;
  message.set_id(kSubscribeId);
  *message.mutable_subscribe() = subscription;
  return message.SerializeAsString();
}

}  // namespace

Feed::Feed(client::Options options, const v1::Subscribe& subscription, Handlers handlers)
    : handlers_(std::move(handlers)),
      request_(serialized(subscription)),
      link_(std::move(options),
            {.up =
                 [this](const v1::HelloReply&, bool) {
                   dropped_ = 0;
                   link_.send(request_);
                 },
             .down =
                 [this](const std::string& reason) {
                   v1::Reply reply;
                   reply.mutable_error()->set_code(v1::ERROR_BUSY);
                   reply.mutable_error()->set_message(reason);
                   handlers_.answered(reply);
                 },
             .message = [this](const std::string& bytes) { on_message(bytes); }}) {}

void Feed::on_message(const std::string& bytes) {
  if (auto frame = relay(bytes)) {
    {
      const std::lock_guard lock(mutex_);
      missed_ += frame->dropped - std::min(dropped_, frame->dropped) + (newest_ ? 1 : 0);
      dropped_ = frame->dropped;
      newest_ = std::move(frame);
    }
    return handlers_.frame();
  }
  v1::ServerMessage message;
  if (!message.ParseFromString(bytes) || !message.has_reply()) return;
  if (message.reply().id() == kSubscribeId) handlers_.answered(message.reply());
}

std::optional<Feed::Taken> Feed::take() {
  const std::lock_guard lock(mutex_);
  if (!newest_) return std::nullopt;
  Taken taken{std::move(*newest_), std::exchange(missed_, 0)};
  newest_.reset();
  return taken;
}

}  // namespace dtact::web
