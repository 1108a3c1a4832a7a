#include "clients/web/foxglove/foxglove_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <exception>
#include <utility>

#include "hal/base/utf8.hpp"

namespace dtact::web::foxglove {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr int kWarning = 1;
constexpr int kError = 2;
/// Bytes that an answer repeats of what a client sent.
constexpr std::size_t kMaxShown = 64;

}  // namespace

FoxgloveClient::FoxgloveClient(std::shared_ptr<WebSocket> socket, std::vector<Mount> mounts,
                               net::Tokens::Grant grant, std::string identity, std::string program,
                               std::function<void(const std::string&)> ended)
    : socket_(std::move(socket)),
      mounts_(std::move(mounts)),
      grant_(std::move(grant)),
      identity_(std::move(identity)),
      program_(std::move(program)),
      ended_(std::move(ended)) {}

void FoxgloveClient::start() {
  send(server_info(program_));
  introduce(0);
  read();
}

void FoxgloveClient::add(Mount place) {
  if (closed_) return;
  mounts_.push_back(std::move(place));
  introduce(mounts_.size() - 1);
}

/// The sensors from there on, with what is known of them.
void FoxgloveClient::introduce(std::size_t first) {
  std::vector<std::string> prefixes;
  for (std::size_t i = first; i < mounts_.size(); ++i) prefixes.push_back(mounts_[i].prefix);
  advertise_channels();
  send(advertise_services(first, prefixes));
  update_want();
  for (std::size_t i = first; i < mounts_.size(); ++i) {
    const Source& source = mounts_[i].sensor->source();
    if (!source.connected()) {
      send(status(kWarning, fmt::format("the daemon of {} is away", source.name()), source.name()));
    }
  }
}

/// Those that it does not know yet, and takes back those that are there no more: behind an address
/// there may be dtactd, and later dtact-perceive.
void FoxgloveClient::advertise_channels() {
  std::vector<Channels> come;
  std::vector<Channels> gone;
  for (std::size_t i = 0; i < mounts_.size(); ++i) {
    Mount& place = mounts_[i];
    const Topics served = served_by(place.sensor->source().daemon());
    if (served == place.reported) continue;
    come.push_back({i, place.prefix, served & ~place.reported});
    gone.push_back({i, place.prefix, place.reported & ~served});
    place.reported = served;
  }
  const auto any = [](const Channels& of) { return of.topics.any(); };
  if (std::ranges::any_of(gone, any)) send(unadvertise(gone));
  if (std::ranges::any_of(come, any)) send(advertise(come));
  // To the protocol they end with their channel. The daemon would refuse what they ask for.
  const auto ended = std::erase_if(subscriptions_, [this](const auto& entry) {
    return !mounts_[entry.second.place].reported.test(index(entry.second.topic));
  });
  if (ended > 0) update_want();
}

void FoxgloveClient::close(const std::string& reason) {
  if (std::exchange(closed_, true)) return;
  socket_->close();
  subscriptions_.clear();
  for (const Mount& place : mounts_) place.sensor->forget(*this);
  ended_(reason);
}

void FoxgloveClient::read() {
  socket_->read_some(asio::buffer(input_), [self = shared_from_this()](const error_code& error,
                                                                       WebSocket::Received got) {
    if (self->closed_) return;
    if (error) {
      return self->close(error == asio::error::eof ? "the client left" : error.message());
    }
    // WebSocket bounds a message.
    self->received_.append(self->input_.data(), got.bytes);
    if (got.end) self->take(got.text);
    if (!self->closed_) self->read();
  });
}

void FoxgloveClient::take(bool text) {
  const std::string message = std::exchange(received_, {});
  if (!requests_.take(1)) return close("more requests a second came than are served");
  if (!text) {
    const auto wanted = parse_call(message);
    if (!wanted) return send(status(kError, "a binary message that is no call of a service"));
    return call(*wanted);
  }
  const auto operation = parse_operation(message);
  if (!operation) return send(status(kError, "a text that is no operation in JSON"));
  if (operation->name == "subscribe") {
    for (const SubscriptionRequest& request : operation->subscribed) subscribe(request);
  } else if (operation->name == "unsubscribe") {
    for (const std::uint32_t id : operation->ended) subscriptions_.erase(id);
  } else {
    return send(status(kWarning, fmt::format("\"{}\" is not done here",
                                             base::first_bytes(operation->name, kMaxShown))));
  }
  if (!closed_) update_want();
}

void FoxgloveClient::subscribe(const SubscriptionRequest& request) {
  const std::size_t number = std::size_t{request.channel} - 1;
  if (request.channel == 0 || number / kTopics >= mounts_.size() ||
      !mounts_[number / kTopics].reported.test(number % kTopics)) {
    return send(status(kError, fmt::format("there is no channel {}", request.channel)));
  }
  if (subscriptions_.contains(request.subscription)) {
    return send(
        status(kError, fmt::format("subscription {} is there already", request.subscription)));
  }
  if (subscriptions_.size() >= kMaxSubscriptions) {
    return send(
        status(kError, fmt::format("{} subscriptions are all there may be", kMaxSubscriptions)));
  }
  Subscription made{number / kTopics, static_cast<Topic>(number % kTopics), nullptr};
  // It is sent at changes only, so a new subscriber gets the last one.
  if (made.topic == Topic::light) made.waiting = mounts_[made.place].sensor->light();
  subscriptions_.emplace(request.subscription, std::move(made));
  if (!writing_) write_next();
}

void FoxgloveClient::update_want() {
  for (std::size_t place = 0; place < mounts_.size(); ++place) {
    Topics wanted;
    for (const auto& [id, subscription] : subscriptions_) {
      if (subscription.place == place) wanted.set(index(subscription.topic));
    }
    mounts_[place].sensor->want(*this, wanted);
  }
}

void FoxgloveClient::call(const Call& call) {
  const std::size_t number = std::size_t{call.service} - 1;
  const auto fail = [&](std::string_view sentence) {
    send(service_failure(call.service, call.call, sentence));
  };
  if (call.service == 0 || number / kServices >= mounts_.size()) {
    return fail("there is no such service");
  }
  if (grant_.rights < net::Rights::control) {
    return fail("this client may view only: connect with a token that allows control");
  }
  if (call.encoding != "json") return fail("only requests in JSON are understood");
  try {
    mounts_[number / kServices].sensor->source().request(
        request_of(static_cast<Service>(number % kServices), call.payload), identity_,
        [weak = weak_from_this(), service = call.service, id = call.call](const v1::Reply& reply) {
          const auto self = weak.lock();
          if (self == nullptr) return;
          if (reply.has_error()) {
            return self->send(service_failure(service, id, reply.error().message()));
          }
          self->send(service_response(service, id, answer_of(reply)), false);
        });
  } catch (const std::exception& e) {
    fail(e.what());
  }
}

void FoxgloveClient::on_message(const SensorTopics& sensor, Topic topic,
                                const std::shared_ptr<const Message>& message) {
  for (auto& [id, subscription] : subscriptions_) {
    if (mounts_[subscription.place].sensor.get() != &sensor || subscription.topic != topic) {
      continue;
    }
    subscription.waiting = message;
  }
  if (!writing_) write_next();
}

void FoxgloveClient::on_state(const SensorTopics& sensor, bool well, const std::string& sentence) {
  advertise_channels();
  const std::string& name = sensor.source().name();
  send(well ? remove_status(name) : status(kWarning, sentence, name));
}

void FoxgloveClient::send(std::string bytes, bool text) {
  if (closed_) return;
  control_.push_back({std::move(bytes), text});
  if (control_.size() > kMaxControl) {
    // Posted, because the sender may be iterating over the listeners.
    asio::post(socket_->executor(), [self = shared_from_this()] {
      self->close("too many answers and notices lay unread");
    });
    return;
  }
  if (!writing_) write_next();
}

void FoxgloveClient::write_next() {
  if (closed_) return;
  if (!control_.empty()) {
    writing_ = true;
    const auto control = std::make_shared<const Control>(std::move(control_.front()));
    control_.pop_front();
    return socket_->write({asio::buffer(control->bytes)}, control->text,
                          [self = shared_from_this(), control](
                              const error_code& error, std::size_t) { self->on_written(error); });
  }
  // From the one behind the last on, so that no channel waits for ever.
  const auto waits = [](const auto& entry) { return entry.second.waiting != nullptr; };
  const auto behind = subscriptions_.upper_bound(last_sent_);
  auto next = std::find_if(behind, subscriptions_.end(), waits);
  if (next == subscriptions_.end()) next = std::find_if(subscriptions_.begin(), behind, waits);
  if (next == subscriptions_.end() || !waits(*next)) return;
  last_sent_ = next->first;
  write_message(next->first, std::exchange(next->second.waiting, nullptr));
}

void FoxgloveClient::write_message(std::uint32_t subscription,
                                   std::shared_ptr<const Message> message) {
  writing_ = true;
  const auto head =
      std::make_shared<const std::string>(message_head(subscription, message->time_ns));
  const WebSocket::Parts parts{asio::buffer(*head), asio::buffer(message->payload)};
  socket_->write(parts, false,
                 [self = shared_from_this(), head, message = std::move(message)](
                     const error_code& error, std::size_t) { self->on_written(error); });
}

void FoxgloveClient::on_written(const error_code& error) {
  writing_ = false;
  if (closed_) return;
  if (error) return close(error.message());
  write_next();
}

}  // namespace dtact::web::foxglove
