#include "daemon/app/throttle_timer.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <thread>

namespace dtact::app {
namespace {

long voluntary_switches() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nvcsw;
}

TEST(ThrottleTimer, PutsAThreadToSleepThatNeverWaits) {
  boost::asio::io_context io(1);
  ThrottleTimer throttle_timer(io);
  const long before = voluntary_switches();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  // Work without an end, as with more clients than can be served.
  std::function<void()> work = [&] {
    if (voluntary_switches() - before >= 2 || std::chrono::steady_clock::now() > end) {
      throttle_timer.stop();
    } else {
      boost::asio::post(io, work);
    }
  };
  boost::asio::post(io, work);
  io.run();
  EXPECT_GE(voluntary_switches() - before, 2);
}

TEST(ThrottleTimer, LeavesNoWorkWhenItIsStoppedAsItsTimeComes) {
  using namespace std::chrono_literals;
  boost::asio::io_context io(1);
  boost::asio::steady_timer sooner(io, 1ms);
  ThrottleTimer throttle_timer(io);
  sooner.async_wait([&](const boost::system::error_code&) { throttle_timer.stop(); });
  std::this_thread::sleep_for(150ms);  // both are due
  io.run_for(10s);
  EXPECT_TRUE(io.stopped());
}

}  // namespace
}  // namespace dtact::app
