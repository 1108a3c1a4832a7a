#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"

namespace dtact::perceive {

/// The connection to the daemon, on a thread of its own: made again whenever it is lost, subscribed
/// to what is wanted at the time. Frames that come while the last one is being worked on take each
/// other's place.
class Upstream {
 public:
  struct Handlers {
    std::function<void()> frame;                     ///< take() has one. On the own thread.
    std::function<void(const std::string&)> notice;  ///< A sentence for the log. The same.
  };

  Upstream(client::Options options, Handlers handlers);
  /// Waits for its thread; a connection attempt under way is let end.
  ~Upstream();
  Upstream(const Upstream&) = delete;
  Upstream& operator=(const Upstream&) = delete;

  /// What to subscribe to from now on; within kPatience.
  void want(const v1::Subscribe& subscription);

  struct Taken {
    v1::Frame frame;
    std::uint64_t missed = 0;  ///< That came after the one before and were replaced.
  };
  /// The newest frame that was not taken yet.
  [[nodiscard]] std::optional<Taken> take();
  [[nodiscard]] std::string serial() const;

 private:
  void run(const std::stop_token& stop);
  void serve(client::Client& client, const std::stop_token& stop);
  void keep(v1::Frame frame);

  static constexpr std::chrono::milliseconds kPatience{20};

  client::Options options_;
  Handlers handlers_;
  mutable std::mutex mutex_;  ///< Of all that follows but the thread.
  v1::Subscribe wanted_;
  bool changed_ = false;
  std::optional<Taken> newest_;
  std::string serial_;
  std::jthread thread_;
};

}  // namespace dtact::perceive
