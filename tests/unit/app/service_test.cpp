#include "daemon/app/service.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <string>

#include "hal/base/unique_fd.hpp"

namespace dtact::app {
namespace {

TEST(Service, SaysNothingWithoutAServiceManager) {
  ::unsetenv("NOTIFY_SOCKET");
  ::unsetenv("WATCHDOG_USEC");
  notify_ready("x");
  EXPECT_EQ(watchdog_interval_us(), 0U);
}

TEST(Service, TellsReadinessWithStatus) {
  const std::string path = ::testing::TempDir() + "dtact_notify_" + std::to_string(::getpid());
  const base::UniqueFd receiver(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(receiver.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
  notify_ready("listening");
  ::unsetenv("NOTIFY_SOCKET");
  std::array<char, 256> buffer{};
  const ssize_t n = ::recv(receiver.get(), buffer.data(), buffer.size(), 0);
  ::unlink(path.c_str());
  ASSERT_GT(n, 0);
  EXPECT_EQ(std::string(buffer.data(), static_cast<std::size_t>(n)), "READY=1\nSTATUS=listening");
}

TEST(Service, WatchdogIsFedTwiceAnInterval) {
  ::setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(watchdog_interval_us(), 5'000'000U);
  ::unsetenv("WATCHDOG_USEC");
}

}  // namespace
}  // namespace dtact::app
