#include "daemon/serve/tcp_watch.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <utility>

namespace dtact::net {
namespace {

using std::chrono::milliseconds;

void set(int socket, int level, int option, std::int64_t value) {
  const int number = static_cast<int>(value);
  // Without it a vanished peer is only found later.
  (void)::setsockopt(socket, level, option, &number, sizeof number);
}

}  // namespace

bool PeerJudge::alive(const TcpProgress& progress, Clock::time_point now) {
  if (!progress.outstanding || progress.acked_bytes != acked_bytes_) moved_ = now;
  acked_bytes_ = progress.acked_bytes;
  standing_ = std::chrono::duration_cast<milliseconds>(now - moved_);
  // The kernel counts from its first probe, at most an interval before moved_ and at
  // most the retransmission time-out after it. So user_timeout() leaves it five intervals. One of
  // them passes before the next update, and an answer to its probes is missing after six and that
  // time-out. Before the standstill there may have been nothing to answer.
  return std::min(standing_, progress.since_ack) < peer_timeout_ * 3 / 4;
}

TcpWatch::TcpWatch(const boost::asio::any_io_executor& executor, int socket,
                   milliseconds peer_timeout)
    : timer_(executor), socket_(socket), judge_(peer_timeout, PeerJudge::Clock::now()) {
  set(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, judge_.user_timeout().count());
  // An idle client has nothing unacknowledged: probes it, to detect that it has vanished.
  const auto seconds = [](milliseconds time) {
    return std::max<std::int64_t>(1, time / milliseconds(1000));
  };
  set(socket, SOL_SOCKET, SO_KEEPALIVE, 1);
  set(socket, IPPROTO_TCP, TCP_KEEPIDLE, seconds(peer_timeout / 2));
  set(socket, IPPROTO_TCP, TCP_KEEPINTVL, seconds(peer_timeout / 6));
  set(socket, IPPROTO_TCP, TCP_KEEPCNT, 3);
}

void TcpWatch::start(std::function<void()> on_dead) {
  on_dead_ = std::move(on_dead);
  wait();
}

void TcpWatch::stop() {
  socket_ = -1;
  on_dead_ = nullptr;
  timer_.cancel();
}

void TcpWatch::wait() {
  timer_.expires_after(judge_.interval());
  timer_.async_wait([weak = weak_from_this()](const boost::system::error_code& error) {
    const auto self = weak.lock();
    if (!error && self != nullptr && self->socket_ >= 0) self->look();
  });
}

void TcpWatch::look() {
  const auto progress = tcp_progress(socket_);
  if (!progress) return;
  const milliseconds before = judge_.user_timeout();
  if (!judge_.alive(*progress, PeerJudge::Clock::now())) {
    return std::exchange(on_dead_, nullptr)();
  }
  if (judge_.user_timeout() != before) {
    set(socket_, IPPROTO_TCP, TCP_USER_TIMEOUT, judge_.user_timeout().count());
  }
  wait();
}

}  // namespace dtact::net
