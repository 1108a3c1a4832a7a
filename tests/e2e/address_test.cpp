// The daemon in a network whose address comes after the daemon's start, as with DHCP.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/ipv6.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"
#include "hal/base/unique_fd.hpp"
#include "tests/e2e/daemon_process.hpp"

namespace dtact::e2e {
namespace {

// Addresses from the ranges for documentation (RFC 5737, RFC 3849): unused.
constexpr const char* kIpv4 = "192.0.2.7";
constexpr const char* kIpv6 = "2001:db8::7";

/// This program and its children get a network namespace in which only loopback is up.
class LateAddress : public ::testing::Test {
 protected:
  void SetUp() override {
    // Without root's rights this needs a user namespace, where one may be made.
    if (::unshare(CLONE_NEWNET) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
      GTEST_SKIP() << "no network namespace can be made here: " << std::strerror(errno);
    }
    v4_ = base::UniqueFd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    ifreq request = loopback();
    request.ifr_flags = IFF_UP | IFF_RUNNING;
    ASSERT_EQ(::ioctl(v4_.get(), SIOCSIFFLAGS, &request), 0) << std::strerror(errno);
  }

  void bring_ipv4() {
    // An alias: 127.0.0.1 stays.
    ifreq request = loopback(":1");
    sockaddr_in address{};
    address.sin_family = AF_INET;
    ASSERT_EQ(::inet_pton(AF_INET, kIpv4, &address.sin_addr), 1);
    std::memcpy(&request.ifr_addr, &address, sizeof address);
    ASSERT_EQ(::ioctl(v4_.get(), SIOCSIFADDR, &request), 0) << std::strerror(errno);
  }
  void bring_ipv6() {
    const base::UniqueFd v6(::socket(AF_INET6, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    in6_ifreq request{};
    ASSERT_EQ(::inet_pton(AF_INET6, kIpv6, &request.ifr6_addr), 1);
    request.ifr6_prefixlen = 128;
    request.ifr6_ifindex = static_cast<int>(::if_nametoindex("lo"));
    ASSERT_EQ(::ioctl(v6.get(), SIOCSIFADDR, &request), 0) << std::strerror(errno);
  }

  /// The kernel makes an IPv6 address's route a little after the address.
  static client::Client connect_soon(const client::Options& options) {
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);;) {
      try {
        return client::Client(options);
      } catch (const client::ConnectionError&) {
        if (std::chrono::steady_clock::now() > end) throw;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  /// The daemon serves no client before `bring` and serves one after it.
  void serves_once_it_comes(const std::string& address, const std::function<void()>& bring) {
    const TempFolder state;
    DaemonProcess daemon({"--set", "camera.backend=null", "--set", "ring.backend=null", "--set",
                          "net.address=" + address, "--set", "net.listen_insecure=true", "--set",
                          "net.port=0", "--set", "state_dir=" + state.path().string()});
    EXPECT_NE(daemon.log().find("no interface has the address " + address + " yet"),
              std::string::npos)
        << daemon.log();
    const client::Options options{.host = address, .port = daemon.port()};
    EXPECT_THROW(client::Client{options}, client::ConnectionError);
    bring();
    const client::Client client = connect_soon(options);
    EXPECT_EQ(client.server().major(), 1U);
    EXPECT_EQ(daemon.stop(SIGTERM), 0);
  }

 private:
  static ifreq loopback(const std::string& alias = "") {
    ifreq request{};
    const std::string name = "lo" + alias;
    std::copy(name.begin(), name.end(), request.ifr_name);
    return request;
  }

  base::UniqueFd v4_;
};

TEST_F(LateAddress, OfIpv4) {
  serves_once_it_comes(kIpv4, [this] { bring_ipv4(); });
}

TEST_F(LateAddress, OfIpv6) {
  if (::access("/proc/net/if_inet6", F_OK) != 0) GTEST_SKIP() << "this kernel has no IPv6";
  serves_once_it_comes(kIpv6, [this] { bring_ipv6(); });
}

TEST(LocalSocket, LiesInTheFolderOfTheUnit) {
  const TempFolder folder;
  DaemonProcess daemon({"--set", "camera.backend=null", "--set", "ring.backend=null", "--set",
                        "net.port=0", "--set", "state_dir=" + folder.path().string()},
                       {{"RUNTIME_DIRECTORY", folder.path().string()}});
  const auto socket = folder.path() / "dtactd.sock";
  EXPECT_TRUE(std::filesystem::is_socket(socket));
  EXPECT_NE(daemon.log().find("listening on " + socket.string()), std::string::npos)
      << daemon.log();
  const client::Client client(client::Options{.port = daemon.port()});
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
  EXPECT_FALSE(std::filesystem::exists(socket));
}

}  // namespace
}  // namespace dtact::e2e
