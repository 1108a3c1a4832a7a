#include "clients/perceive/upstream.hpp"

#include <condition_variable>
#include <utility>

namespace dtact::perceive {
namespace {

/// Between attempts to reach a daemon that is not there.
constexpr std::chrono::seconds kPause{1};

/// Waits, but not beyond `stop`.
void pause(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any changed;
  std::unique_lock lock(mutex);
  changed.wait_for(lock, stop, kPause, [] { return false; });
}

}  // namespace

Upstream::Upstream(client::Options options, Handlers handlers)
    : options_(std::move(options)),
      handlers_(std::move(handlers)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

Upstream::~Upstream() = default;

void Upstream::want(const v1::Subscribe& subscription) {
  const std::lock_guard lock(mutex_);
  wanted_ = subscription;
  changed_ = true;
}

std::optional<Upstream::Taken> Upstream::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(newest_, std::nullopt);
}

std::string Upstream::serial() const {
  const std::lock_guard lock(mutex_);
  return serial_;
}

void Upstream::run(const std::stop_token& stop) {
  std::string told;
  while (!stop.stop_requested()) {
    try {
      client::Client client(options_);
      told.clear();
      {
        const std::lock_guard lock(mutex_);
        serial_ = client.server().serial();
        changed_ = true;
      }
      handlers_.notice("connected to " + client.server().program() + " at " + options_.host);
      serve(client, stop);
    } catch (const std::exception& e) {
      // The same once.
      if (std::exchange(told, e.what()) != e.what()) handlers_.notice(e.what());
      pause(stop);
    }
  }
}

void Upstream::serve(client::Client& client, const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::optional<v1::Subscribe> subscription;
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(changed_, false)) subscription = wanted_;
    }
    if (subscription) {
      // Raw values cost least where they need not travel.
      if (subscription->depth() != v1::DEPTH_NONE && !client.same_machine() &&
          client.has_feature("predict_zstd")) {
        subscription->set_depth(v1::DEPTH_PREDICT_ZSTD);
      }
      client.subscribe(*subscription);
    }
    auto item = client.next(kPatience);
    if (!item) continue;
    if (auto* frame = std::get_if<v1::Frame>(&*item)) keep(std::move(*frame));
  }
}

void Upstream::keep(v1::Frame frame) {
  {
    const std::lock_guard lock(mutex_);
    const std::uint64_t missed = newest_ ? newest_->missed + 1 : 0;
    newest_ = Taken{std::move(frame), missed};
  }
  handlers_.frame();
}

}  // namespace dtact::perceive
