#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "clients/cpp/connection.hpp"
#include "clients/cpp/options.hpp"
#include "hal/base/unique_fd.hpp"
#include "proto/dtact.pb.h"

namespace dtact::cli {

/// A connection to a daemon that passes its messages on unchanged, on a thread of its own. It
/// reconnects whenever the connection is lost.
class Link {
 public:
  /// Called on the link's own thread. An exception ends the connection; the next one begins.
  struct Handlers {
    /// The daemon answered Hello; the bool: it is on this machine.
    std::function<void(v1::HelloReply, bool)> up;
    std::function<void(std::string)> down;  ///< Why it is away; again with another reason.
    std::function<void(const std::string&)> message;  ///< A ServerMessage as it came.
  };

  Link(client::Options options, Handlers handlers);
  /// Joins the thread, which a host name lookup may delay. After stop(), ended() reports when this
  /// no longer blocks.
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// A ClientMessage, serialized. Lost when the connection is away, or breaks before it is written.
  void send(std::string message);
  /// Reaches the daemon with these from the next connection on.
  void use(client::Options options);
  /// Lets the thread end. No handler is called after the one that runs.
  void stop() noexcept;
  [[nodiscard]] bool ended() const noexcept { return ended_; }

 private:
  void run();
  [[nodiscard]] v1::HelloReply greet(client::Connection& connection,
                                     const client::Options& options) const;
  void serve(client::Connection& connection, std::chrono::milliseconds timeout);
  void forget_outgoing();
  void wake() const noexcept;
  void drain() const noexcept;

  Handlers handlers_;
  base::UniqueFd wake_;  ///< An eventfd: there is something to send, or the end.
  base::UniqueFd stop_;  ///< An eventfd that stays readable once stop() was called.
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> ended_ = false;
  std::mutex mutex_;
  // Under the mutex:
  client::Options options_;
  bool up_ = false;
  std::vector<std::string> outgoing_;
  std::thread thread_;
};

}  // namespace dtact::cli
