#include "clients/web/foxglove/sensor_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "clients/cpp/errors.hpp"

namespace dtact::web::foxglove {

namespace {

/// As long as the page's: places of a daemon that has none become free.
constexpr std::chrono::seconds kRetry{5};

}  // namespace

SensorTopics::SensorTopics(std::shared_ptr<Source> source)
    : source_(std::move(source)), retry_(source_->io()) {}

void SensorTopics::start() {
  source_->follow(this, {.changed = [this] { on_changed(); },
                         .event = [this](const auto& message) { on_event(message.event()); }});
}

void SensorTopics::stop() {
  retry_.cancel();
  source_->unfollow(this);
  source_->leave(this);
  listeners_.clear();
}

void SensorTopics::want(Listener& listener, Topics wanted) {
  listeners_[&listener] = wanted;
  update();
}

void SensorTopics::forget(Listener& listener) {
  listeners_.erase(&listener);
  update();
}

Topics SensorTopics::wanted() const {
  Topics all;
  for (const auto& [listener, topics] : listeners_) all |= topics;
  return all;
}

void SensorTopics::update() {
  if (!source_->connected()) return;
  const v1::Subscribe request = subscription_for(wanted());
  if (request.SerializeAsString() == asked_) return;
  asked_ = request.SerializeAsString();
  source_->subscribe(
      {.who = this, .owner = "Foxglove", .may_control = true}, request,
      [this](const v1::Reply& reply) {
        if (!reply.has_error()) {
          if (std::exchange(refused_, false)) publish_state(true, "");
          return;
        }
        refused_ = true;
        asked_.reset();
        ask_again_later();
        publish_state(false, reply.error().message());
      },
      [this](const RelayedFrame& frame, std::uint64_t) { on_frame(frame); });
}

void SensorTopics::ask_again_later() {
  retry_.expires_after(kRetry);
  retry_.async_wait([weak = weak_from_this()](const boost::system::error_code& error) {
    const auto self = weak.lock();
    if (!error && self != nullptr) self->update();
  });
}

void SensorTopics::on_changed() {
  asked_.reset();
  light_.reset();
  const bool well = source_->connected();
  publish_state(
      well,
      well ? "" : fmt::format("the daemon of {} is away: {}", source_->name(), source_->reason()));
  update();
}

void SensorTopics::publish_state(bool well, const std::string& sentence) {
  for (const auto& [listener, topics] : listeners_) listener->on_state(*this, well, sentence);
}

void SensorTopics::publish(Topic topic, const std::shared_ptr<const Message>& message) {
  if (message == nullptr) return;
  for (const auto& [listener, topics] : listeners_) {
    if (topics.test(index(topic))) listener->on_message(*this, topic, message);
  }
}

void SensorTopics::on_event(const v1::Event& event) {
  if (!wanted().test(index(Topic::event))) return;
  const auto time_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, event.wall_ns()));
  publish(Topic::event,
          std::make_shared<const Message>(Message{time_ns, event.SerializeAsString()}));
}

void SensorTopics::on_frame(const RelayedFrame& relayed) {
  v1::Frame frame;
  if (!frame.ParseFromString(relayed.encoded->body)) return;
  const Topics wanted = this->wanted();
  for (const TopicInfo& info : topics()) {
    if (info.topic == Topic::light || !wanted.test(index(info.topic))) continue;
    try {
      publish(info.topic, message_of(info.topic, frame));
    } catch (const client::ProtocolError& e) {
      publish_state(false, e.what());
    }
  }
  if (wanted.test(index(Topic::points))) clear_points(frame);
  // Each light once.
  const auto light = message_of(Topic::light, frame);
  if (light == nullptr || (light_ != nullptr && light_->payload == light->payload)) return;
  light_ = light;
  publish(Topic::light, light_);
}

/// The points of a contact that has ended would stay on the screen.
void SensorTopics::clear_points(const v1::Frame& frame) {
  if (frame.has_cloud()) {
    points_shown_ = true;
  } else if (points_shown_ && frame.has_contact() && !frame.contact().in_contact()) {
    points_shown_ = false;
    publish(Topic::points, points_of(frame));
  }
}

}  // namespace dtact::web::foxglove
