#include "daemon/app/service.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/fakes/notify_socket.hpp"

namespace dtact::app {
namespace {

TEST(Service, SaysNothingWithoutAServiceManager) {
  ::unsetenv("NOTIFY_SOCKET");
  ::unsetenv("WATCHDOG_USEC");
  notify_ready("x");
  EXPECT_EQ(watchdog_interval_us(), 0U);
}

TEST(Service, TellsReadinessWithStatus) {
  const fakes::NotifySocket manager(std::filesystem::path(::testing::TempDir()) /
                                    ("dtact_notify_" + std::to_string(::getpid())));
  ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1);
  notify_ready("listening");
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(manager.next(std::chrono::seconds(10)), "READY=1\nSTATUS=listening");
}

TEST(Service, WatchdogIsFedTwiceAnInterval) {
  ::setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(watchdog_interval_us(), 5'000'000U);
  ::unsetenv("WATCHDOG_USEC");
}

}  // namespace
}  // namespace dtact::app
