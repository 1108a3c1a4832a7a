#include "clients/cpp/session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <utility>

#include "clients/cpp/channel.hpp"
#include "clients/cpp/errors.hpp"
#include "proto/framing.hpp"

namespace dtact::client {
namespace {

/// Throws what an error of the daemon is to the caller.
[[noreturn]] void refuse(const v1::Reply& reply) {
  const v1::Error& error = reply.error();
  switch (error.code()) {
    case v1::ERROR_VERSION:
      throw ProtocolError(error.message());
    case v1::ERROR_BAD_MESSAGE:
    case v1::ERROR_TOO_LARGE:
    case v1::ERROR_FLOOD:
      throw EndedByDaemon(error.code(), error.message());
    default:
      // Id 0: no answer, but why the connection ends.
      if (reply.id() == 0) throw EndedByDaemon(error.code(), error.message());
      throw Refused(error.code(), error.message());
  }
}

/// Trying again by itself cannot help.
bool is_final(const ConnectionError& error) {
  return dynamic_cast<const ProtocolError*>(&error) != nullptr ||
         dynamic_cast<const IdentityError*>(&error) != nullptr;
}

}  // namespace

v1::Hello hello_for(const Options& options, const Connection& connection) {
  if (!options.token.empty() && !connection.confidential() && !options.insecure) {
    throw IdentityError(fmt::format(
        "the token was not sent: {} is another machine, and over plain TCP any "
        "host on the way could read it. Give the daemon's fingerprint (dtactctl cert --show "
        "prints it there), or allow this explicitly with insecure",
        connection.name()));
  }
  v1::Hello hello;
  hello.set_major(wire::kMajor);
  hello.set_minor(wire::kMinor);
  hello.set_program(options.program.substr(0, wire::kMaxProgramName));
  hello.set_token(options.token);
  return hello;
}

/// A call in progress. Throws Error after a fork, or while another thread is in a call.
class Session::Call {
 public:
  explicit Call(Session& session) : session_(session) {
    if (const pid_t here = ::getpid(); here != session.process_) {
      throw Error(
          fmt::format("process {} made this client, and this is process {}: after a fork, "
                      "make a client of its own there",
                      session.process_, here));
    }
    pid_t other = 0;
    if (!session.thread_.compare_exchange_strong(other, ::gettid())) {
      throw Error(
          fmt::format("thread {} is in a call of this client: one thread at a time may use "
                      "it; make a client for each thread",
                      other));
    }
  }
  ~Call() { session_.thread_ = 0; }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

 private:
  Session& session_;
};

Session::Session(const Options& options)
    : options_(options),
      backoff_(options.reconnect.value_or(Reconnect{}), std::random_device{}()),
      process_(::getpid()) {
  open({after(options_.timeout)});
}

void Session::open(const Limit& limit) {
  connection_ = std::make_unique<Connection>(options_, limit);
  local_ = connection_->local();
  v1::ClientMessage message;
  *message.mutable_hello() = hello_for(options_, *connection_);
  server_ = exchange(message, limit).hello();
  opened_ = Clock::now();
}

void Session::reopen(int wake) {
  const Limit limit{after(options_.timeout), wake};
  const std::size_t before = inbox_.size();
  inbox_.emplace_back(Reconnected{
      loss_.reason, std::chrono::floor<std::chrono::milliseconds>(Clock::now() - loss_.since),
      last_sequence_});
  try {
    open(limit);
    if (subscription_) {
      v1::ClientMessage message;
      *message.mutable_subscribe() = *subscription_;
      (void)exchange(message, limit);
    }
  } catch (const Error& e) {
    inbox_.resize(std::min(before, inbox_.size()));
    lose(e.what());
    const auto* refused = dynamic_cast<const Refused*>(&e);
    if (refused != nullptr && refused->code() == v1::ERROR_BUSY) {
      throw EndedByDaemon(refused->code(), e.what());
    }
    throw;
  }
  lost_ = false;
}

void Session::lose(const std::string& reason) {
  const auto now = Clock::now();
  connection_.reset();
  if (!std::exchange(lost_, true)) {
    loss_ = {reason, now, now};
    // A daemon that takes the connection and ends it at once is not asked any oftener for that.
    if (options_.reconnect && now - opened_ > options_.reconnect->max) backoff_.reset();
  }
  loss_.retry_at = now + backoff_.next();
}

bool Session::wait_for_turn(const Limit& limit) const {
  (void)wait(-1, 0, {std::min(limit.end, loss_.retry_at), limit.wake});
  return Clock::now() >= loss_.retry_at;
}

std::optional<v1::ServerMessage> Session::receive(const Limit& limit) {
  const std::string* bytes = connection_->read(limit);
  if (bytes == nullptr) return std::nullopt;
  v1::ServerMessage message;
  if (!message.ParseFromString(*bytes)) {
    throw ProtocolError("the answer was no dtact message: is there another program on this port?");
  }
  return message;
}

void Session::keep(v1::ServerMessage& message) {
  // Not a kind of event that this library does not know.
  if (message.has_event() && message.event().what_case() != v1::Event::WHAT_NOT_SET) {
    inbox_.emplace_back(std::move(*message.mutable_event()));
  }
  if (!message.has_frame()) return;
  last_sequence_ = message.frame().sequence();
  const auto is_frame = [](const Item& item) { return std::holds_alternative<v1::Frame>(item); };
  const auto kept = static_cast<std::size_t>(std::ranges::count_if(inbox_, is_frame));
  if (kept >= std::max<std::size_t>(1, options_.kept_frames)) {
    inbox_.erase(std::ranges::find_if(inbox_, is_frame));
  }
  inbox_.emplace_back(std::move(*message.mutable_frame()));
}

v1::Reply Session::exchange(v1::ClientMessage& message, const Limit& limit) {
  const std::uint64_t id = next_id_++;
  message.set_id(id);
  if (message.ByteSizeLong() > wire::kMaxMessage) {
    throw Refused(v1::ERROR_TOO_LARGE,
                  fmt::format("the request has {} bytes, at most {} can be sent",
                              message.ByteSizeLong(), wire::kMaxMessage));
  }
  connection_->write(message.SerializeAsString(), limit);
  for (;;) {
    auto received = receive(limit);
    if (!received.has_value()) {
      throw TimeoutError("the daemon gave no answer in time: look at journalctl -u dtactd");
    }
    if (!received->has_reply()) {
      keep(*received);
      if (Clock::now() < limit.end) continue;
      throw TimeoutError("the daemon streams, but gave no answer in time");
    }
    auto& reply = *received->mutable_reply();
    if (reply.id() != id && reply.id() != 0) continue;
    if (!reply.has_error()) return std::move(reply);
    refuse(reply);
  }
}

v1::Reply Session::request(v1::ClientMessage& message, std::chrono::milliseconds timeout) {
  const Call call(*this);
  if (!connection_) {
    if (Clock::now() < loss_.retry_at) throw ConnectionError(loss_.reason);
    reopen(-1);
  }
  try {
    return exchange(message, {after(timeout, message.ByteSizeLong())});
  } catch (const TimeoutError&) {
    throw;
  } catch (const ConnectionError& e) {
    if (options_.reconnect) lose(e.what());
    throw;
  }
}

void Session::subscribe(const v1::Subscribe& subscription) {
  v1::ClientMessage message;
  *message.mutable_subscribe() = subscription;
  (void)request(message, options_.timeout);
  subscription_ = subscription;
  // Frames that came before the answer are of the earlier subscription.
  std::erase_if(inbox_, [](const Item& item) { return std::holds_alternative<v1::Frame>(item); });
}

std::optional<Item> Session::next(const Limit& limit) {
  const Call call(*this);
  for (;;) {
    if (!inbox_.empty()) {
      std::optional<Item> item(std::move(inbox_.front()));
      inbox_.pop_front();
      return item;
    }
    if (!connection_) {
      if (!wait_for_turn(limit)) return std::nullopt;
      try {
        reopen(limit.wake);
      } catch (const ConnectionError& e) {
        if (is_final(e)) throw;
      }
      continue;
    }
    try {
      auto message = receive(limit);
      if (!message.has_value()) return std::nullopt;
      keep(*message);
      if (message->has_reply() && message->reply().id() == 0 && message->reply().has_error()) {
        refuse(message->reply());
      }
    } catch (const ConnectionError& e) {
      if (!options_.reconnect) throw;
      lose(e.what());
      if (is_final(e)) throw;
    }
  }
}

}  // namespace dtact::client
