#pragma once

#include <boost/asio/steady_timer.hpp>

#include "hal/base/realtime_throttle.hpp"

namespace boost::asio {
class io_context;
}

namespace dtact::app {

/// Calls base::RealtimeThrottle on the network thread ten times a second, for when the thread has
/// more clients than it can serve. Logs it when the thread has lost its priority all the same. On
/// the thread that runs `io`.
class ThrottleTimer {
 public:
  explicit ThrottleTimer(boost::asio::io_context& io);
  /// Then `io` has no work of it left.
  void stop();

 private:
  void wait();

  boost::asio::steady_timer timer_;
  base::RealtimeThrottle throttle_;
  bool reported_ = false;
  bool stopped_ = false;
};

}  // namespace dtact::app
