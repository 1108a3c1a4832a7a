#include "daemon/app/watchdog.hpp"

#include <boost/asio/io_context.hpp>
#include <utility>

#include "daemon/app/service.hpp"

namespace dtact::app {

Watchdog::Watchdog(boost::asio::io_context& io, std::function<std::uint64_t()> heartbeat)
    : timer_(io),
      heartbeat_(std::move(heartbeat)),
      interval_(watchdog_interval_us()),
      last_(heartbeat_()) {
  if (interval_.count() > 0) wait();
}

void Watchdog::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

void Watchdog::wait() {
  timer_.expires_after(interval_);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || stopped_) return;
    const std::uint64_t now = heartbeat_();
    if (now != last_) notify_alive();
    last_ = now;
    wait();
  });
}

}  // namespace dtact::app
