#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "clients/cpp/backoff.hpp"
#include "clients/cpp/client.hpp"
#include "clients/cpp/connection.hpp"

namespace dtact::client {

/// The Hello to send over `connection`. Throws IdentityError rather than give the token to a peer
/// that is not known. Not part of the library's interface.
[[nodiscard]] v1::Hello hello_for(const Options& options, const Connection& connection);

/// A greeted connection with its subscription, both made again after a loss where Options ask for
/// it. Not part of the library's interface.
class Session {
 public:
  /// Throws what Client's constructor does.
  explicit Session(const Options& options);

  /// The answer to `message`, whose id is set here. Throws Refused, TimeoutError, ConnectionError.
  v1::Reply request(v1::ClientMessage& message, std::chrono::milliseconds timeout);
  /// The same, kept for the next connection.
  void subscribe(const v1::Subscribe& subscription);
  /// See Client::next().
  std::optional<Item> next(const Limit& limit);

  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const v1::HelloReply& server() const noexcept { return server_; }
  [[nodiscard]] bool local() const noexcept { return local_; }
  [[nodiscard]] int native_handle() const noexcept {
    return connection_ ? connection_->native_handle() : -1;
  }

 private:
  using Clock = std::chrono::steady_clock;
  class Call;
  struct Loss {
    std::string reason;
    Clock::time_point since;
    Clock::time_point retry_at;
  };

  void open(const Limit& limit);
  /// One attempt, given up when `wake` can be read.
  void reopen(int wake);
  void lose(const std::string& reason);
  [[nodiscard]] bool wait_for_turn(const Limit& limit) const;
  v1::Reply exchange(v1::ClientMessage& message, const Limit& limit);
  [[nodiscard]] std::optional<v1::ServerMessage> receive(const Limit& limit);
  void keep(v1::ServerMessage& message);

  Options options_;
  std::unique_ptr<Connection> connection_;  ///< Null while it is lost.
  v1::HelloReply server_;
  bool local_ = false;
  std::optional<v1::Subscribe> subscription_;
  std::uint64_t next_id_ = 1;
  std::uint64_t last_sequence_ = 0;
  std::deque<Item> inbox_;
  Loss loss_;          ///< What the connection was lost by, while `lost_`.
  bool lost_ = false;  ///< From then until one is open again, subscription and all.
  Clock::time_point opened_;
  BackOff backoff_;
  pid_t process_;                 ///< That made the session.
  std::atomic<pid_t> thread_{0};  ///< That is in a call now; 0: none.
};

}  // namespace dtact::client
