#include "daemon/app/watchdog.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "tests/fakes/notify_socket.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::app {
namespace {

using namespace std::chrono_literals;

class WatchdogTest : public ::testing::Test {
 protected:
  WatchdogTest() { ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1); }

 public:
  ~WatchdogTest() override {
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
  }

 protected:
  /// Number of watchdog messages sent to systemd.
  [[nodiscard]] int reported() const {
    int count = 0;
    while (const auto message = manager.next(0ms)) {
      EXPECT_EQ(*message, "WATCHDOG=1");
      ++count;
    }
    return count;
  }

  fakes::NotifySocket manager{fakes::own_path()};
  boost::asio::io_context io{1};
};

TEST_F(WatchdogTest, IsFedWhileTheHeartMoves) {
  ::setenv("WATCHDOG_USEC", "20000", 1);
  std::uint64_t beats = 0;
  const Watchdog watchdog(io, [&] { return ++beats; });
  for (int i = 0; i < 5; ++i) io.run_one();
  EXPECT_EQ(reported(), 5);
}

TEST_F(WatchdogTest, IsNotFedWhileTheHeartStandsStill) {
  ::setenv("WATCHDOG_USEC", "20000", 1);
  std::uint64_t beats = 7;  // not zero when the watch begins
  Watchdog watchdog(io, [&] { return beats; });
  for (int i = 0; i < 5; ++i) io.run_one();
  EXPECT_EQ(reported(), 0);
  ++beats;
  for (int i = 0; i < 5; ++i) io.run_one();
  EXPECT_EQ(reported(), 1);
  watchdog.stop();
  io.run();  // ends: nothing is left to do
  EXPECT_EQ(reported(), 0);
}

TEST_F(WatchdogTest, LeavesNoWorkWhenItIsStoppedAsItsTimeComes) {
  ::setenv("WATCHDOG_USEC", "20000", 1);
  boost::asio::steady_timer sooner(io, 1ms);
  Watchdog watchdog(io, [] { return 1; });
  sooner.async_wait([&](const boost::system::error_code&) { watchdog.stop(); });
  std::this_thread::sleep_for(50ms);  // both are due
  io.run_for(10s);
  EXPECT_TRUE(io.stopped());
}

TEST_F(WatchdogTest, HasNoWorkWhereNoWatchdogIsSet) {
  ::unsetenv("WATCHDOG_USEC");
  std::uint64_t beats = 0;
  const Watchdog watchdog(io, [&] { return ++beats; });
  io.run();
  EXPECT_EQ(reported(), 0);
}

}  // namespace
}  // namespace dtact::app
