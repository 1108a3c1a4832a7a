#include "clients/common/link.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <random>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "clients/cpp/backoff.hpp"
#include "clients/cpp/session.hpp"

namespace dtact::cli {
namespace {

using Clock = std::chrono::steady_clock;

/// Between attempts to reach a daemon that is not there: one that restarts is back within a second.
constexpr client::Reconnect kPauses{std::chrono::milliseconds(200),
                                    std::chrono::milliseconds(2000)};
/// Longest wait; other threads wake this one when there is work.
constexpr std::chrono::hours kForever{24};
constexpr std::uint64_t kHelloId = 1;

}  // namespace

Link::Link(client::Options options, Handlers handlers)
    : handlers_(std::move(handlers)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      stop_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      options_(std::move(options)) {
  if (!wake_ || !stop_) throw std::system_error(errno, std::generic_category(), "eventfd");
  thread_ = std::thread([this] { run(); });
}

Link::~Link() {
  stop();
  thread_.join();
}

void Link::send(std::string message) {
  {
    const std::lock_guard lock(mutex_);
    if (!up_) return;
    outgoing_.push_back(std::move(message));
  }
  wake();
}

void Link::use(client::Options options) {
  const std::lock_guard lock(mutex_);
  options_ = std::move(options);
}

void Link::stop() noexcept {
  stopping_ = true;
  (void)::eventfd_write(stop_.get(), 1);
  wake();
}

void Link::wake() const noexcept {
  const std::uint64_t one = 1;
  // Fails only when it is awake already.
  (void)!::write(wake_.get(), &one, sizeof one);
}

void Link::run() {
  client::BackOff pauses(kPauses, std::random_device{}());
  std::string reported;
  // A daemon that greets and ends the connection at once is not asked any oftener for that.
  auto lasted_from = Clock::time_point::max();
  while (!stopping_) {
    try {
      const client::Options options = [this] {
        const std::lock_guard lock(mutex_);
        return options_;
      }();
      client::Connection connection(options, {client::after(options.timeout), wake_.get()});
      v1::HelloReply daemon = greet(connection, options);
      {
        const std::lock_guard lock(mutex_);
        up_ = true;
      }
      reported.clear();
      lasted_from = Clock::now() + kPauses.max;
      handlers_.up(std::move(daemon), connection.local());
      serve(connection, options.timeout);
    } catch (const std::exception& e) {
      forget_outgoing();
      if (stopping_) break;
      if (Clock::now() > std::exchange(lasted_from, Clock::time_point::max())) pauses.reset();
      if (std::exchange(reported, e.what()) != e.what()) handlers_.down(reported);
      (void)client::wait(-1, 0, {Clock::now() + pauses.next(), wake_.get()});
    }
  }
  ended_ = true;
}

/// What was meant for the connection that is lost is not for the next one.
void Link::forget_outgoing() {
  {
    const std::lock_guard lock(mutex_);
    up_ = false;
    outgoing_.clear();
  }
  drain();
}

/// Waits only for what comes from here on.
void Link::drain() const noexcept {
  std::uint64_t count = 0;
  (void)!::read(wake_.get(), &count, sizeof count);
}

v1::HelloReply Link::greet(client::Connection& connection, const client::Options& options) const {
  const client::Limit limit{client::after(options.timeout), wake_.get()};
  v1::ClientMessage hello;
  hello.set_id(kHelloId);
  *hello.mutable_hello() = client::hello_for(options, connection);
  connection.write(hello.SerializeAsString(), limit);
  const std::string* bytes = connection.read(limit);
  if (bytes == nullptr) {
    throw std::runtime_error(connection.name() + " does not answer: look at journalctl -u dtactd");
  }
  v1::ServerMessage answer;
  if (!answer.ParseFromString(*bytes) || !answer.has_reply()) {
    throw std::runtime_error(connection.name() +
                             " is no dtactd: is there another program on this port?");
  }
  if (answer.reply().has_error()) throw std::runtime_error(answer.reply().error().message());
  return std::move(*answer.mutable_reply()->mutable_hello());
}

void Link::serve(client::Connection& connection, std::chrono::milliseconds timeout) {
  for (;;) {
    // First, so that a wake-up by stop() is not consumed unnoticed.
    drain();
    if (stopping_) return;
    std::vector<std::string> outgoing;
    {
      const std::lock_guard lock(mutex_);
      outgoing.swap(outgoing_);
    }
    for (const std::string& message : outgoing) {
      connection.write(message, {client::after(timeout, message.size()), stop_.get()});
    }
    // One message at a time: a handler slower than the stream always finds the next one waiting,
    // and what is to be sent would never go out.
    const std::string* message = connection.read({Clock::now() + kForever, wake_.get()});
    if (message != nullptr) handlers_.message(*message);
  }
}

}  // namespace dtact::cli
