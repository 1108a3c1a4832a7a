#pragma once

#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <functional>

namespace boost::asio {
class io_context;
}

namespace dtact::app {

/// Tells systemd's watchdog (WatchdogSec= of the unit) that the daemon is alive: twice an interval,
/// and only when the heartbeat has moved since the last time. A thread that hangs inside a driver
/// so ends the daemon, and systemd starts it anew. Does nothing where no watchdog is set. On the
/// thread that runs `io`.
class Watchdog {
 public:
  /// `heartbeat`: a count that goes on as long as the watched thread works.
  Watchdog(boost::asio::io_context& io, std::function<std::uint64_t()> heartbeat);
  /// Then `io` has no work of it left.
  void stop();

 private:
  void wait();

  boost::asio::steady_timer timer_;
  bool stopped_ = false;
  std::function<std::uint64_t()> heartbeat_;
  std::chrono::microseconds interval_;
  std::uint64_t last_;
};

}  // namespace dtact::app
