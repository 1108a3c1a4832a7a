// Hostile peers, and peers that behave like them: one daemon stands all of them one after another
// while an honest client streams and another commands. Effects of a test machine's load (missed
// frames, delays) are measured and printed; requirements that hold on any machine are asserted.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "proto/defaults.hpp"
#include "tests/e2e/besieged.hpp"
#include "tests/e2e/patience.hpp"
#include "tests/unit/net/raw_client.hpp"

namespace dtact::e2e {
namespace {

using net::test::RawClient;

class Hostile : public testing::Test {
 public:
  static Besieged* daemon;

 protected:
  static void SetUpTestSuite() {
    daemon = new Besieged;
    // The daemon has set its own limit before.
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 8192);
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  static void TearDownTestSuite() {
    delete daemon;
    daemon = nullptr;
  }
  void SetUp() override { daemon->begin(); }
};
Besieged* Hostile::daemon = nullptr;

/// A connection on which no call waits long.
base::UniqueFd knock() {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(Hostile::daemon->port());
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const timeval timeout{60, 0};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  if (::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) fd.reset();
  return fd;
}

void send_all(const base::UniqueFd& fd, const std::string& bytes) {
  for (std::size_t sent = 0; sent < bytes.size();) {
    const ssize_t n = ::send(fd.get(), bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) return;
    sent += static_cast<std::size_t>(n);
  }
}

void reset(base::UniqueFd fd) {
  const linger now{1, 0};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
}

/// The daemon's last error code before it ends the connection; ERROR_NONE without an error. A
/// silence of a minute counts as kept.
constexpr int kKept = -1;
int last_word(const base::UniqueFd& fd) {
  wire::MessageDecoder decoder;
  int code = v1::ERROR_NONE;
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::recv(fd.get(), buffer, sizeof buffer, 0);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return kKept;
    if (n <= 0) return code;
    std::string_view unread(buffer, static_cast<std::size_t>(n));
    while (decoder.feed(unread) == wire::MessageDecoder::Result::message) {
      v1::ServerMessage message;
      if (!message.ParseFromString(decoder.message())) ADD_FAILURE() << "no ServerMessage";
      if (message.reply().has_error()) code = message.reply().error().code();
    }
  }
}

/// The first reply, or nothing when the daemon ends the connection without one.
std::optional<v1::Reply> first_answer(const base::UniqueFd& fd) {
  wire::MessageDecoder decoder;
  char byte = 0;
  while (::recv(fd.get(), &byte, 1, 0) == 1) {
    std::string_view unread(&byte, 1);
    if (decoder.feed(unread) != wire::MessageDecoder::Result::message) continue;
    v1::ServerMessage message;
    if (message.ParseFromString(decoder.message()) && message.has_reply()) return message.reply();
  }
  return std::nullopt;
}

std::string with_length(const std::string& body) {
  const auto length = wire::encode_length(body.size());
  return std::string(reinterpret_cast<const char*>(length.data()), length.size()) + body;
}

TEST_F(Hostile, Garbage) {
  const std::map<std::string, int> kinds = {
      {std::string("\xff\xff\xff\xff", 4), v1::ERROR_TOO_LARGE},
      {"GET / HTTP/1.1\r\nHost: sensor\r\n\r\n", v1::ERROR_TOO_LARGE},
      {std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11),
       v1::ERROR_TOO_LARGE},  // TLS
      {with_length(""), v1::ERROR_BAD_MESSAGE},
      {with_length("\xff\xff\xff\xff"), v1::ERROR_BAD_MESSAGE},
      {with_length(std::string(900, '\x80')), v1::ERROR_BAD_MESSAGE},
      {with_length(std::string("\x08\x01\x1a\x00", 4)), v1::ERROR_VERSION}};  // Subscribe first
  for (int i = 0; i < 100; ++i) {
    for (const auto& [bytes, code] : kinds) {
      const base::UniqueFd fd = knock();
      ASSERT_TRUE(fd);
      send_all(fd, bytes);
      ASSERT_EQ(last_word(fd), code) << testing::PrintToString(bytes);
    }
  }
  daemon->end("700 connections of garbage");
}

TEST_F(Hostile, TenThousandConnections) {
  for (int i = 0; i < 10'000; ++i) {
    base::UniqueFd fd = knock();
    ASSERT_TRUE(fd) << i;
    if (i % 2 == 0) reset(std::move(fd));
  }
  daemon->end("10,000 connections one after another");
}

TEST_F(Hostile, ThousandsAtOnce) {
  v1::ClientMessage hello;
  hello.set_id(1);
  hello.mutable_hello()->set_major(wire::kMajor);
  const std::string bytes = with_length(hello.SerializeAsString());
  std::vector<base::UniqueFd> peers;
  for (int i = 0; i < 4000; ++i) {
    peers.push_back(knock());
    if (peers.back()) send_all(peers.back(), bytes);
  }
  int served = 0;
  int reported = 0;
  for (const auto& peer : peers) {
    const auto answer = first_answer(peer);
    if (!answer) continue;
    if (answer->has_hello()) {
      ++served;
    } else {
      EXPECT_EQ(answer->error().code(), v1::ERROR_BUSY) << answer->error().message();
      ++reported;
    }
  }
  EXPECT_GT(served, 0);
  EXPECT_EQ(served + reported, 4000) << "some were refused without a word";
  std::printf("of 4000 at once %d were served and %d of the others got the reason\n", served,
              reported);
  peers.clear();
  daemon->end("4000 connections at once");
}

TEST_F(Hostile, SixteenMebibytesBeforeHello) {
  // The announced length is within the cap of a message, and a mebibyte of it is sent.
  const std::string bytes = std::string("\x01\x00\x00\x00", 4) + std::string(1 << 20, 'x');
  std::vector<base::UniqueFd> peers;
  for (int i = 0; i < 200; ++i) {
    peers.push_back(knock());
    ASSERT_TRUE(peers.back());
    const timeval soon{0, 100'000};
    ::setsockopt(peers.back().get(), SOL_SOCKET, SO_SNDTIMEO, &soon, sizeof soon);
    send_all(peers.back(), bytes);
  }
  EXPECT_LE(held_by(daemon->pid()).resident_kib, daemon->at_rest().resident_kib + kMemorySlackKib);
  peers.clear();
  daemon->end("200 peers that announce 16 MiB before Hello");
}

TEST_F(Hostile, FloodOfRequests) {
  RawClient flood(daemon->port());
  flood.hello();
  v1::ClientMessage request;
  request.set_id(7);
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  // With sanitizers a status takes so long that the daemon makes few more of them than it allows,
  // and ends the connection for the answers that lie unread.
  request.mutable_ping();
#else
  request.mutable_get_status();
#endif
  const std::string one = with_length(request.SerializeAsString());
  std::string many;
  for (int i = 0; i < 50'000; ++i) many += one;
  std::thread writer([&] { flood.send_bytes(many); });
  int code = v1::ERROR_NONE;
  int answers = 0;
  while (const auto message = flood.receive()) {
    if (message->reply().has_status() || message->reply().has_pong()) ++answers;
    if (message->reply().has_error()) code = message->reply().error().code();
    if (answers == 50'000) break;
  }
  EXPECT_EQ(code, v1::ERROR_FLOOD);
  flood.die();
  writer.join();
  daemon->end("50,000 requests at once");
}

TEST_F(Hostile, SlowReaders) {
  std::list<RawClient> slow;
  for (int i = 0; i < 12; ++i) {
    slow.emplace_back(daemon->port(), 4096);
    slow.back().hello();
    slow.back().subscribe(v1::DEPTH_INT16);
  }
  ASSERT_TRUE(daemon->honest().receive(240)) << daemon->honest().broken();
  // Each client is still served once it reads, and its next frame counts what it missed.
  for (auto& client : slow) {
    while (client.frame().dropped() == 0) {
    }
  }
  slow.clear();
  daemon->end("12 slow readers");
}

TEST_F(Hostile, AMapOfItsOwnForEverybody) {
  // With sanitizers a whole map takes a tenth of a second.
  constexpr std::uint32_t kSide = kSlower == 1 ? 10'000 : 64;
  std::list<RawClient> picky;
  for (std::uint32_t i = 0; i < 12; ++i) {
    picky.emplace_back(daemon->port());
    picky.back().hello();
    v1::ClientMessage message;
    auto& subscribe = *message.mutable_subscribe();
    subscribe.set_depth(v1::DEPTH_INT16);
    subscribe.set_um_per_unit(2);
    subscribe.mutable_box()->set_x(i);
    subscribe.mutable_box()->set_width(kSide);
    subscribe.mutable_box()->set_height(kSide);
    ASSERT_TRUE(picky.back().request(message).has_done());
  }
  for (auto& client : picky) {
    while (!client.frame().has_depth()) {
    }
  }
  picky.clear();
  daemon->end("12 clients with a map of their own");
}

TEST_F(Hostile, StoppedReaders) {
  std::vector<pid_t> stopped;
  const std::string port = std::to_string(daemon->port());
  for (int i = 0; i < 8; ++i) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      ::dup2(::open("/dev/null", O_WRONLY), STDOUT_FILENO);
      ::execl(DTACTCTL_PROGRAM, DTACTCTL_PROGRAM, "--port", port.c_str(), "watch", "--json",
              static_cast<char*>(nullptr));
      ::_exit(127);
    }
    stopped.push_back(pid);
  }
  {
    client::Client asking = daemon->sensor().connect("asking");
    while (asking.status().clients_size() < 11) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    for (const pid_t pid : stopped) ::kill(pid, SIGSTOP);
    ASSERT_TRUE(daemon->honest().receive(240)) << daemon->honest().broken();
    EXPECT_EQ(asking.status().clients_size(), 11) << "one that was only stopped was thrown out";
  }
  for (const pid_t pid : stopped) {
    ::kill(pid, SIGCONT);
    ::kill(pid, SIGTERM);
    ::waitpid(pid, nullptr, 0);
  }
  daemon->end("8 readers that were stopped");
}

TEST_F(Hostile, ReconnectStorm) {
  std::atomic<int> greeted{0};
  std::vector<std::thread> storm;
  for (int t = 0; t < 8; ++t) {
    storm.emplace_back([&greeted] {
      for (int i = 0; i < 100; ++i) {
        try {
          RawClient client(daemon->port());
          client.hello();
          client.subscribe(v1::DEPTH_INT16);
          ++greeted;
          if (i % 2 == 0) client.die();
        } catch (const std::runtime_error&) {  // NOLINT(bugprone-empty-catch)
          // Refused: there may be too many.
        }
      }
    });
  }
  for (auto& thread : storm) thread.join();
  EXPECT_GT(greeted, 0);
  daemon->end("800 clients that subscribe and leave, " + std::to_string(greeted) + " were served");
}

}  // namespace
}  // namespace dtact::e2e
