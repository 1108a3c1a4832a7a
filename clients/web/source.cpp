#include "clients/web/source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <exception>
#include <utility>

#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"

namespace dtact::web {

namespace asio = boost::asio;

namespace {

/// Bytes of a request that count as one more at the daemon.
constexpr std::size_t kCounted = std::size_t{64} * 1024;

bool wants_frames(const v1::Subscribe& request) {
  return request.depth() != v1::DEPTH_NONE || request.luma() != v1::LUMA_NONE || request.jpeg() ||
         request.summary() || request.cloud() != v1::CLOUD_NONE || request.pose() ||
         request.recognition();
}

/// Requests that change nothing.
bool only_reads(v1::ClientMessage::RequestCase request) {
  switch (request) {
    case v1::ClientMessage::kGetStatus:
    case v1::ClientMessage::kGetCalibration:
    case v1::ClientMessage::kListCalibrations:
    case v1::ClientMessage::kGetReference:
    case v1::ClientMessage::kPing:
      return true;
    case v1::ClientMessage::kHello:
    case v1::ClientMessage::kSubscribe:
    case v1::ClientMessage::kSetLight:
    case v1::ClientMessage::kSetCamera:
    case v1::ClientMessage::kRezero:
    case v1::ClientMessage::kSetReconstruction:
    case v1::ClientMessage::kUploadCalibration:
    case v1::ClientMessage::kActivateCalibration:
    case v1::ClientMessage::kPinCalibration:
    case v1::ClientMessage::REQUEST_NOT_SET:
      return false;
  }
  return false;
}

v1::Reply done() {
  v1::Reply reply;
  reply.mutable_done();
  return reply;
}

}  // namespace

v1::Reply error_reply(v1::ErrorCode code, std::string sentence) {
  v1::Reply reply;
  reply.mutable_error()->set_code(code);
  reply.mutable_error()->set_message(std::move(sentence));
  return reply;
}

Source::Source(asio::io_context& io, std::string name, client::Options daemon, std::string refused)
    : io_(io),
      name_(std::move(name)),
      options_(std::move(daemon)),
      refused_(!refused.empty()),
      reason_(refused_ ? std::move(refused) : "it has not answered yet") {}

void Source::start() {
  if (refused_) return;
  const auto on_io = [weak = weak_from_this(), &io = io_](auto call) {
    asio::post(io, [weak, call = std::move(call)]() mutable {
      const auto self = weak.lock();
      if (self != nullptr && self->link_ != nullptr) call(*self);
    });
  };
  link_ = std::make_unique<cli::Link>(
      options_,
      cli::Link::Handlers{
          .up =
              [on_io](v1::HelloReply daemon, bool) {
                on_io([daemon = std::move(daemon)](Source& self) { self.on_up(daemon); });
              },
          .down =
              [on_io](std::string reason) {
                on_io([reason = std::move(reason)](Source& self) { self.on_down(reason); });
              },
          .message =
              [on_io](const std::string& bytes) {
                v1::ServerMessage message;
                if (!message.ParseFromString(bytes)) return;
                on_io([message = std::move(message)](Source& self) { self.on_message(message); });
              }});
}

void Source::use(client::Options daemon) {
  options_ = std::move(daemon);
  if (link_ != nullptr) link_->use(options_);
  for (const Stream& stream : streams_) stream.feed->use(options_);
}

void Source::stop() {
  link_.reset();
  streams_.clear();
  retired_.clear();
  pending_.clear();
}

void Source::on_up(const v1::HelloReply& daemon) {
  daemon_ = daemon;
  connected_ = true;
  reason_.clear();
  notify_all();
}

void Source::on_down(const std::string& reason) {
  connected_ = false;
  reason_ = reason;
  for (const auto& [id, answered] : std::exchange(pending_, {})) answered(away());
  for (Stream& stream : streams_) {
    for (Member& member : stream.members) {
      if (member.answered) std::exchange(member.answered, nullptr)(away());
    }
    stream.members.clear();
  }
  retire_empty();
  notify_all();
}

void Source::notify_all() {
  for (const auto& [who, follower] : followers_) follower.changed();
}

v1::Reply Source::away() const {
  return error_reply(v1::ERROR_DEVICE,
                     fmt::format("the daemon of {} is away, and asked for again all the time: {}",
                                 name_, reason_));
}

void Source::on_message(const v1::ServerMessage& message) {
  if (message.has_event()) {
    for (const auto& [who, follower] : followers_) follower.event(message);
  }
  if (!message.has_reply()) return;
  const auto found = pending_.find(message.reply().id());
  if (found == pending_.end()) return;
  const Answered answered = std::move(found->second);
  pending_.erase(found);
  answered(message.reply());
}

void Source::request(v1::ClientMessage message, const std::string& identity, Answered answered) {
  if (!connected_) return answered(away());
  message.set_on_behalf_of(base::first_bytes(identity, wire::kMaxOnBehalfOf));
  const std::size_t cost = 1 + message.ByteSizeLong() / kCounted;
  const double reserve = only_reads(message.request_case()) ? kReservedRequests : 0;
  if (!requests_.take(static_cast<double>(cost), reserve)) {
    return answered(
        error_reply(v1::ERROR_BUSY,
                    "the viewers of this gateway together ask more than the daemon answers: "
                    "ask again later"));
  }
  message.set_id(next_id_);
  pending_.emplace(next_id_++, std::move(answered));
  link_->send(message.SerializeAsString());
}

std::string Source::no_room_for(const Subscriber& subscriber) const {
  // The stream that it leaves for the new one does not count. It leaves one that the daemon has
  // agreed to: others that it asked for are still being opened.
  const auto stays = [&](const Stream& stream) {
    return !stream.agreed || std::ranges::any_of(stream.members, [&](const Member& member) {
      return member.who != subscriber.who;
    });
  };
  const auto all = static_cast<std::size_t>(std::ranges::count_if(streams_, stays));
  const auto own = static_cast<std::size_t>(std::ranges::count_if(
      streams_, [&](const auto& one) { return stays(one) && one.owner == subscriber.owner; }));
  if (own >= kMaxFeedsOfOne) {
    return fmt::format(
        "{} has {} different subscriptions to {} and no more are made: subscribe to what another "
        "viewer does, or end one",
        subscriber.owner, own, name_);
  }
  if (all < kMaxFeeds - (subscriber.may_control ? 0 : kReservedFeeds)) return {};
  return fmt::format(
      "the viewers of this gateway have {} different subscriptions to {} and no more are made: "
      "subscribe to what another one does, or end one",
      all, name_);
}

void Source::subscribe(const Subscriber& subscriber, v1::Subscribe request, Answered answered,
                       OnFrame frame) {
  const void* const who = subscriber.who;
  if (!connected_) return answered(away());
  const std::uint64_t serial = next_serial_++;
  if (!wants_frames(request)) {
    for (Stream& stream : streams_) {
      for (Member& member : stream.members) {
        if (member.who == who && member.answered) std::exchange(member.answered, nullptr)(done());
      }
    }
    leave(who);
    return answered(done());
  }
  request.set_events(false);
  const std::string key = request.SerializeAsString();
  auto stream = std::ranges::find(streams_, key, &Stream::key);
  if (stream == streams_.end()) {
    if (std::string sentence = no_room_for(subscriber); !sentence.empty()) {
      return answered(error_reply(v1::ERROR_BUSY, std::move(sentence)));
    }
    const std::uint64_t number = next_serial_++;
    try {
      streams_.push_back({number, key, subscriber.owner, open(number, request), false, {}});
    } catch (const std::exception& e) {
      // It has a thread and a descriptor of its own.
      return answered(
          error_reply(v1::ERROR_BUSY,
                      fmt::format("no more subscriptions to {} are made: {}", name_, e.what())));
    }
    stream = std::prev(streams_.end());
  }
  // One that was refused leaves those that are still being opened.
  newest_[who] = serial;
  stream->members.push_back({who, serial, std::move(answered), std::move(frame)});
  if (stream->agreed) settle(*stream, done());
}

std::shared_ptr<Feed> Source::open(std::uint64_t stream, const v1::Subscribe& request) {
  const auto on_io = [weak = weak_from_this(), &io = io_](auto call) {
    asio::post(io, [weak, call = std::move(call)] {
      if (const auto self = weak.lock()) call(*self);
    });
  };
  return std::make_shared<Feed>(
      options_, request,
      Feed::Handlers{
          .answered =
              [on_io, stream](const v1::Reply& reply) {
                on_io([stream, reply](Source& self) { self.on_answered(stream, reply); });
              },
          .frame = [on_io, stream] { on_io([stream](Source& self) { self.on_frame(stream); }); }});
}

Source::Stream* Source::find(std::uint64_t stream) {
  const auto found = std::ranges::find(streams_, stream, &Stream::number);
  return found == streams_.end() ? nullptr : &*found;
}

void Source::on_answered(std::uint64_t number, const v1::Reply& reply) {
  Stream* const stream = find(number);
  // One that flowed before is made again by itself.
  if (stream == nullptr || (stream->agreed && reply.has_error())) return;
  stream->agreed = !reply.has_error();
  settle(*stream, reply);
}

void Source::settle(Stream& stream, const v1::Reply& reply) {
  const auto waits = [](const Member& member) { return member.answered != nullptr; };
  const auto joins = [&](const Member& member) {
    return stream.agreed && newest_[member.who] == member.serial;
  };
  std::vector<std::pair<const void*, std::uint64_t>> joined;
  for (const Member& member : stream.members) {
    if (waits(member) && joins(member)) joined.emplace_back(member.who, member.serial);
  }
  // The previous stream sends no frame after the answer.
  for (Stream& other : streams_) {
    for (const auto& mover : joined) {
      std::erase_if(other.members, [&](const Member& member) {
        return member.who == mover.first && member.serial < mover.second && !waits(member);
      });
    }
  }
  for (Member& member : stream.members) {
    if (!waits(member)) continue;
    if (!joins(member)) member.frame = nullptr;
    std::exchange(member.answered, nullptr)(reply);
  }
  std::erase_if(stream.members, [](const Member& member) { return member.frame == nullptr; });
  retire_empty();
}

void Source::on_frame(std::uint64_t number) {
  Stream* const stream = find(number);
  if (stream == nullptr) return;
  const auto taken = stream->feed->take();
  if (!taken) return;
  for (const Member& member : stream->members) {
    if (!member.answered) member.frame(taken->frame, taken->missed);
  }
}

void Source::leave(const void* who) {
  newest_.erase(who);
  for (Stream& stream : streams_) {
    std::erase_if(stream.members, [who](const Member& member) { return member.who == who; });
  }
  retire_empty();
}

void Source::retire_empty() {
  for (Stream& stream : streams_) {
    if (!stream.members.empty()) continue;
    stream.feed->stop();
    retired_.push_back(std::move(stream.feed));
  }
  std::erase_if(streams_, [](const Stream& stream) { return stream.feed == nullptr; });
  std::erase_if(retired_, [](const auto& feed) { return feed->ended(); });
}

}  // namespace dtact::web
