#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/serve/tcp_progress.hpp"

namespace dtact::net {

/// Distinguishes a peer that stopped reading from one that is gone, by the kernel's state of the
/// connection.
///
/// A program that does not read (a debugger, a notebook) closes its window. Nothing more can be
/// sent, but its kernel keeps answering our kernel's probes. TCP_USER_TIMEOUT alone ends even this
/// connection, however often it is answered (tcp_probe_timer() in Linux' net/ipv4/tcp_timer.c,
/// since 5.11). Without it the probes become ever rarer, up to two minutes apart. So it is set,
/// and extended as long as the peer answers: the kernel then probes at least as often as it
/// says (tcp_clamp_probe0_to_user_timeout()), which detects a peer that no longer answers.
class PeerJudge {
 public:
  using Clock = std::chrono::steady_clock;

  PeerJudge(std::chrono::milliseconds peer_timeout, Clock::time_point now)
      : peer_timeout_(peer_timeout), moved_(now) {}

  /// How often to look.
  [[nodiscard]] std::chrono::milliseconds interval() const { return peer_timeout_ / 16; }
  /// False: the peer is gone. user_timeout() is what TCP_USER_TIMEOUT is to be from here on.
  [[nodiscard]] bool alive(const TcpProgress& progress, Clock::time_point now);
  /// While nothing stands still it bounds the keep-alive's probes, of which some may be lost.
  [[nodiscard]] std::chrono::milliseconds user_timeout() const {
    return standing_.count() == 0 ? peer_timeout_ : standing_ + peer_timeout_ * 3 / 8;
  }

 private:
  std::chrono::milliseconds peer_timeout_;
  Clock::time_point moved_;  ///< When the peer had taken everything, or took something.
  std::uint64_t acked_bytes_ = 0;
  std::chrono::milliseconds standing_{0};  ///< Since moved_.
};

/// Looks at one connection from time to time. On the network thread.
class TcpWatch : public std::enable_shared_from_this<TcpWatch> {
 public:
  /// Sets the socket's keep-alive and TCP_USER_TIMEOUT. `socket` is only looked at.
  TcpWatch(const boost::asio::any_io_executor& executor, int socket,
           std::chrono::milliseconds peer_timeout);

  /// Calls `on_dead` once when the peer is gone, unless stop() came before.
  void start(std::function<void()> on_dead);
  /// Before the socket is closed: its number may soon be another's.
  void stop();

 private:
  void wait();
  void look();

  boost::asio::steady_timer timer_;
  int socket_;
  PeerJudge judge_;
  std::function<void()> on_dead_;
};

}  // namespace dtact::net
