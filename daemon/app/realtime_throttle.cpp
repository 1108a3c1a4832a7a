#include "daemon/app/realtime_throttle.hpp"

#include <sys/resource.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <thread>

namespace dtact::app {
namespace {

constexpr std::chrono::milliseconds kInterval{100};
constexpr std::chrono::milliseconds kPause{1};

long voluntary_switches() noexcept {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nvcsw;
}

}  // namespace

RealtimeThrottle::RealtimeThrottle(boost::asio::io_context& io) : timer_(io) { wait(); }

void RealtimeThrottle::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

void RealtimeThrottle::wait() {
  timer_.expires_after(kInterval);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || stopped_) return;
    if (voluntary_switches() == waits_) std::this_thread::sleep_for(kPause);
    waits_ = voluntary_switches();
    wait();
  });
}

}  // namespace dtact::app
