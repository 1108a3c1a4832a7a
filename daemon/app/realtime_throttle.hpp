#pragma once

#include <boost/asio/steady_timer.hpp>

namespace boost::asio {
class io_context;
}

namespace dtact::app {

/// Keeps the real-time network thread from running on and on. With more clients than it can serve
/// it never waits: other programs on its CPU would get nothing, and the unit's LimitRTTIME= would
/// end the daemon. Ten times a second it looks whether the thread has waited since, and if not, has
/// it sleep for a millisecond. On the thread that runs `io`.
class RealtimeThrottle {
 public:
  explicit RealtimeThrottle(boost::asio::io_context& io);
  /// Then `io` has no work of it left.
  void stop();

 private:
  void wait();

  boost::asio::steady_timer timer_;
  bool stopped_ = false;
  long waits_ = 0;  ///< Voluntary context switches when last looked at.
};

}  // namespace dtact::app
