// Which address of a host is connected to, and who may use a connection.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <sys/wait.h>

#include <thread>

#include "clients/cpp/client.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace {

using Lookup = int (*)(const char*, const char*, const addrinfo*, addrinfo**);

}  // namespace

// The host "silent-first" has the addresses 127.0.0.3 and 127.0.0.1, in this order.
// NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name)
extern "C" int getaddrinfo(const char* host, const char* service, const addrinfo* hints,
                           addrinfo** found) {
  static const auto system = reinterpret_cast<Lookup>(::dlsym(RTLD_NEXT, "getaddrinfo"));
  if (std::string_view(host) != "silent-first") return system(host, service, hints, found);
  if (const int error = system("127.0.0.3", service, hints, found); error != 0) return error;
  return system("127.0.0.1", service, hints, &(*found)->ai_next);
}

namespace dtact::client::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::AllOf;
using testing::HasSubstr;

std::uint16_t port_of(const base::UniqueFd& listening) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  ::getsockname(listening.get(), reinterpret_cast<sockaddr*>(&address), &size);
  return ntohs(address.sin_port);
}

/// 127.0.0.3, where the kernel drops what asks for a connection: its queue is full.
class SilentAddress {
 public:
  explicit SilentAddress(std::uint16_t port) : listening_(listen_on(port, kAddress)) {
    ::listen(listening_.get(), 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(kAddress);
    for (base::UniqueFd& fd : waiting_) {
      fd = base::UniqueFd(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
      (void)::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address);
    }
  }

 private:
  static constexpr in_addr_t kAddress = INADDR_LOOPBACK + 2;
  base::UniqueFd listening_;
  std::array<base::UniqueFd, 4> waiting_;
};

TEST(Connecting, ASilentAddressDoesNotDelayTheNextOne) {
  auto listening = listen_on();
  const std::uint16_t port = port_of(listening);
  const SilentAddress silent(port);
  PlayedDaemon daemon({[](Peer& peer) { peer.greet(); }}, std::move(listening));
  Options options;
  options.host = "silent-first";
  options.port = port;
  options.timeout = std::chrono::seconds(30);
  const auto began = steady_clock::now();
  const Client client(options);
  const auto took = steady_clock::now() - began;
  EXPECT_EQ(client.server().program(), "dtactd 9.8.7");
  EXPECT_GE(took, milliseconds(250));
  EXPECT_LT(took, std::chrono::seconds(10));
}

TEST(Connecting, NamesWhatAnAddressAnsweredWhenTheOthersAreSilent) {
  std::uint16_t port = 0;
  {
    const auto listening = listen_on();
    port = port_of(listening);
  }
  const SilentAddress silent(port);
  Options options;
  options.host = "silent-first";
  options.port = port;
  options.timeout = milliseconds(600);
  try {
    const Client client(options);
    ADD_FAILURE() << "connected to nobody";
  } catch (const ConnectionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("nothing listens on silent-first"));
  }
}

TEST(Using, TheLongestTimeoutIsNoneInThePast) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.done();
    std::this_thread::sleep_for(milliseconds(100));
    peer.frame(7);
    (void)peer.ends_silently();
  }});
  daemon.options.timeout = milliseconds::max();
  Client client(daemon.options);
  client.rezero();
  EXPECT_TRUE(client.next(milliseconds::max()).has_value());
  EXPECT_FALSE(client.next(milliseconds::min()).has_value());
}

// Before: up to four frames as the earlier subscription had asked came after the later one's
// answer.
TEST(Using, ASubscriptionsFramesAreItsOwn) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.done();
    peer.frame(41);
    const v1::ClientMessage again = peer.request();
    peer.frame(42);
    v1::ServerMessage done;
    done.mutable_reply()->set_id(again.id());
    done.mutable_reply()->mutable_done();
    peer.send(done);
    peer.frame(43);
  }});
  Client client(daemon.options);
  client.subscribe();
  client.subscribe();
  const auto item = client.next(kLong);
  ASSERT_TRUE(item && std::holds_alternative<v1::Frame>(*item));
  EXPECT_EQ(std::get<v1::Frame>(*item).sequence(), 43U);
}

TEST(Using, ASecondThreadIsNamedAndTheFirstGoesOn) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.answer({});
    peer.frame(7);
    (void)peer.ends_silently();
  }});
  Client client(daemon.options);
  std::jthread waiting([&client](const std::stop_token& stop) { client.run({}, stop); });
  std::this_thread::sleep_for(milliseconds(100));
  try {
    client.ping();
    ADD_FAILURE() << "two threads at once";
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("thread "), HasSubstr("one thread at a time")));
  }
  waiting.request_stop();
  waiting.join();
  client.ping();
  EXPECT_TRUE(client.next(kLong).has_value());
}

TEST(Using, AForkedProcessIsNamed) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    peer.answer({});
    (void)peer.ends_silently();
  }});
  Client client(daemon.options);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    try {
      client.ping();
    } catch (const Error& e) {
      const bool named = std::string_view(e.what()).find(
                             "process " + std::to_string(::getppid())) != std::string_view::npos;
      ::_exit(named ? 0 : 2);
    }
    ::_exit(1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  client.ping();
}

}  // namespace
}  // namespace dtact::client::test
