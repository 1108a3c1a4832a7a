#include "daemon/app/service.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "tests/fakes/notify_socket.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::app {
namespace {

TEST(Service, SaysNothingWithoutAServiceManager) {
  ::unsetenv("NOTIFY_SOCKET");
  ::unsetenv("WATCHDOG_USEC");
  notify_ready("x");
  EXPECT_EQ(watchdog_interval_us(), 0U);
}

TEST(Service, ReportsReadinessWithStatus) {
  const fakes::NotifySocket manager(fakes::own_path());
  ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1);
  notify_ready("listening");
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(manager.next(std::chrono::seconds(10)), "READY=1\nSTATUS=listening");
}

// The queue of a datagram socket holds net.unix.max_dgram_qlen messages.
TEST(Service, DoesNotWaitForAManagerThatDoesNotRead) {
  const fakes::NotifySocket manager(fakes::own_path());
  ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1);
  int reported = 0;
  while (reported < 100'000 && notify_status("serving")) ++reported;
  notify_alive();
  EXPECT_LT(reported, 100'000);
  EXPECT_GE(reported, 1);
  EXPECT_EQ(manager.next(std::chrono::seconds(10)), "STATUS=serving");
  EXPECT_TRUE(notify_status("serving again"));
  ::unsetenv("NOTIFY_SOCKET");
}

TEST(Service, FindsAManagerByAnAbstractName) {
  const std::string name = "@dtact_notify_" + std::to_string(::getpid());
  const fakes::NotifySocket manager(name);
  ::setenv("NOTIFY_SOCKET", name.c_str(), 1);
  notify_stopping();
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(manager.next(std::chrono::seconds(10)), "STOPPING=1");
}

// Fed twice only, a thread that is blocked for more than half the time may end the daemon.
TEST(Service, WatchdogIsFedEightTimesAPeriod) {
  ::setenv("WATCHDOG_USEC", "10000000", 1);
  EXPECT_EQ(watchdog_interval_us(), 1'250'000U);
  ::unsetenv("WATCHDOG_USEC");
}

TEST(Service, ReportsThatItReadsItsConfigurationAgain) {
  const fakes::NotifySocket manager(fakes::own_path());
  ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1);
  notify_reloading();
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_THAT(manager.next(std::chrono::seconds(10)).value_or(""),
              testing::MatchesRegex("RELOADING=1\nMONOTONIC_USEC=[0-9]+"));
}

// The machine's name would be the same for all instances on it.
TEST(Service, ANameIsTheUnitsBeforeTheMachines) {
  ::unsetenv("DTACTD_NAME");
  const std::string machine = default_name();
  EXPECT_FALSE(machine.empty());
  ::setenv("DTACTD_NAME", "", 1);
  EXPECT_EQ(default_name(), machine);
  ::setenv("DTACTD_NAME", "gripper-left", 1);
  EXPECT_EQ(default_name(), "gripper-left");
  ::unsetenv("DTACTD_NAME");
}

TEST(Service, ACredentialIsTheFileThatSystemdHandedIn) {
  const auto folder = fakes::own_path();
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "tokens") << "x";
  ::setenv("CREDENTIALS_DIRECTORY", folder.c_str(), 1);
  EXPECT_EQ(resolve_credential("net.tokens", "credential:tokens"), folder / "tokens");
  EXPECT_EQ(resolve_credential("net.tokens", "/etc/tokens"), "/etc/tokens");
  EXPECT_EQ(resolve_credential("net.tokens", ""), "");
  const auto missing = [](const char* name) {
    try {
      return resolve_credential("net.tls_key", name).string();
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
  };
  EXPECT_THAT(missing("credential:tls-key"),
              testing::StartsWith("net.tls_key = \"credential:tls-key\": systemd handed in no "
                                  "credential of that name: put it into "
                                  "/etc/credstore/dtactd.tls-key "));
  ::unsetenv("CREDENTIALS_DIRECTORY");
  EXPECT_THAT(missing("credential:tokens"), testing::HasSubstr("/etc/credstore/dtactd.tokens"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace dtact::app
