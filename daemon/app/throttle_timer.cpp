#include "daemon/app/throttle_timer.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <utility>

#include "hal/base/rt_thread.hpp"

namespace dtact::app {
namespace {

constexpr std::chrono::milliseconds kPause{1};

}  // namespace

ThrottleTimer::ThrottleTimer(boost::asio::io_context& io)
    : timer_(io), throttle_(base::system_clock(), kPause) {
  wait();
}

void ThrottleTimer::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

void ThrottleTimer::wait() {
  timer_.expires_after(base::RealtimeThrottle::kInterval);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || stopped_) return;
    throttle_.pause_if_busy();
    if (base::was_demoted() && !std::exchange(reported_, true)) {
      spdlog::warn("{}", base::demoted_sentence("network"));
    }
    wait();
  });
}

}  // namespace dtact::app
