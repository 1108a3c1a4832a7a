#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "clients/common/link.hpp"
#include "clients/perceive/newest_frame.hpp"

namespace dtact::perceive {

/// The connection to the daemon, made again whenever it is lost, subscribed to what is wanted at
/// the time. Frames that come while the last one is being worked on take each other's place.
class Upstream {
 public:
  /// On the connection's own thread.
  struct Handlers {
    std::function<void()> frame;                     ///< take() has one.
    std::function<void(const std::string&)> notice;  ///< A sentence for the log.
  };

  /// Its end waits for the connection's thread; an attempt under way is let end.
  Upstream(client::Options options, Handlers handlers);

  /// What to subscribe to from now on.
  void want(const v1::Subscribe& subscription);

  /// The newest frame that was not taken yet.
  [[nodiscard]] std::optional<NewestFrame::Taken> take();
  /// What the daemon last said of itself; empty before it was reached.
  [[nodiscard]] v1::HelloReply daemon() const;
  /// Why the daemon is away; empty while it is connected.
  [[nodiscard]] std::string away() const;

 private:
  void on_up(v1::HelloReply daemon, bool same_machine);
  void on_down(const std::string& reason);
  void on_message(const std::string& bytes);
  void subscribe();

  const Handlers handlers_;
  const std::string host_;
  mutable std::mutex mutex_;  ///< Guards all members below but the link.
  v1::Subscribe wanted_;
  bool compressed_ = false;  ///< Depth, since it travels.
  NewestFrame newest_;
  v1::HelloReply daemon_;
  std::string away_ = "the daemon is not connected yet";
  cli::Link link_;  ///< Last: its thread uses the others.
};

}  // namespace dtact::perceive
