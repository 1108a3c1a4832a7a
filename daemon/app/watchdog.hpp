#pragma once

#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <functional>

namespace boost::asio {
class io_context;
}

namespace dtact::app {

/// Notifies systemd's watchdog (WatchdogSec= of the unit) that the daemon is alive: eight times a
/// period, and only when the heartbeat has advanced since the last time. So when a thread hangs
/// inside a driver, systemd restarts the daemon, but not for a block of seven eighths of the
/// period. Does nothing where no watchdog is set. Runs on the thread that runs `io`.
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
