// Many clients, dead clients, hostile clients.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <memory>
#include <thread>

#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

base::UniqueFd raw_connection(std::uint16_t port) {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const timeval timeout{20, 0};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  return fd;
}

/// Sends bytes and reads until the daemon ends the connection. Returns what came back.
std::string talk(std::uint16_t port, const std::string& bytes) {
  const base::UniqueFd fd = raw_connection(port);
  EXPECT_EQ(::send(fd.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(bytes.size()));
  std::string answer;
  char buffer[4096];
  for (;;) {
    const ssize_t n = ::recv(fd.get(), buffer, sizeof buffer, 0);
    if (n == 0) return answer;
    if (n < 0) {
      ADD_FAILURE() << "the daemon kept the connection";
      return answer;
    }
    answer.append(buffer, static_cast<std::size_t>(n));
  }
}

int count_frames(client::Client& client, int wanted) {
  int frames = 0;
  (void)read_until(client, [&](const Item& item) {
    return std::holds_alternative<v1::Frame>(item) && ++frames == wanted;
  });
  return frames;
}

TEST(Clients, SixteenOfWhichOneNeverReads) {
  const Sensor sensor;
  // Says Hello with the library and subscribes to frames, then never reads again.
  client::Client deaf = sensor.connect("deaf");
  deaf.subscribe();
  std::vector<std::unique_ptr<client::Client>> clients;
  v1::Subscribe small;  // fifteen full streams would be a gigabyte a second
  small.set_summary(true);
  for (int i = 0; i < 15; ++i) {
    clients.push_back(std::make_unique<client::Client>(sensor.connect()));
    clients.back()->subscribe(small);
  }
  std::vector<std::thread> threads;
  std::vector<int> frames(clients.size());
  for (std::size_t i = 0; i < clients.size(); ++i) {
    threads.emplace_back([&, i] { frames[i] = count_frames(*clients[i], 180); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const int n : frames) EXPECT_EQ(n, 180);
  // The daemon answers at once, and reports which client did not read.
  const v1::Status status = clients[0]->status();
  EXPECT_EQ(status.clients_size(), 16);
  for (const auto& c : status.clients()) {
    if (c.program() == "deaf") {
      EXPECT_GT(c.dropped(), 50U);
    }
  }
}

TEST(Clients, OneThatReadsLateGetsTheNewestFrames) {
  const Sensor sensor;
  v1::Subscribe luma;
  luma.set_luma(v1::LUMA_GREY8);
  client::Client late = sensor.connect("late");
  late.subscribe(luma);
  // The kernel gives a fast reader a larger buffer.
  ASSERT_EQ(count_frames(late, 120), 120);
  client::Client prompt = sensor.connect("prompt");
  prompt.subscribe();
  ASSERT_EQ(count_frames(prompt, 120), 120);
  std::uint64_t newest = 0;
  ASSERT_TRUE(read_until(prompt, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame != nullptr) newest = frame->sequence();
    return frame != nullptr;
  }));
  // At most one in the socket, one that the daemon began to send, and one that it replaces.
  constexpr int kOld = 4;
  int old = 0;
  ASSERT_TRUE(read_until(late, [&](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    if (frame != nullptr && frame->sequence() < newest) ++old;
    return frame != nullptr && frame->sequence() >= newest;
  }));
  EXPECT_LE(old, kOld);
}

TEST(Clients, OneKilledMidStreamDoesNotDisturbTheOthers) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe();
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      client::Client doomed = sensor.connect("doomed");
      doomed.subscribe();
      for (;;) (void)doomed.next(std::chrono::seconds(1));
    } catch (const std::exception&) {
      ::_exit(1);
    }
  }
  EXPECT_EQ(count_frames(client, 60), 60);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(count_frames(client, 120), 120);
  EXPECT_EQ(client.status().clients_size(), 1);
}

TEST(Clients, MalformedAndOversizedMessagesEndOnlyTheirConnection) {
  const Sensor sensor;
  client::Client client = sensor.connect();
  client.subscribe();
  // Length above the cap, no protobuf, another protocol, only a length.
  EXPECT_NE(talk(sensor.daemon->port(), std::string("\xff\xff\xff\xff", 4)), "");
  EXPECT_NE(talk(sensor.daemon->port(), std::string("\0\0\0\4\xff\xff\xff\xff", 8)), "");
  EXPECT_NE(talk(sensor.daemon->port(), "GET / HTTP/1.1\r\n\r\n"), "");
  {
    const base::UniqueFd half = raw_connection(sensor.daemon->port());
  }
  EXPECT_EQ(count_frames(client, 30), 30);
}

TEST(Clients, NewestLightWinsAndEveryClientIsReported) {
  const Sensor sensor;
  client::Client one = sensor.connect("one");
  client::Client two = sensor.connect("two");
  v1::SetLight change;
  change.set_brightness(200);
  (void)one.set_light(change);
  change.set_brightness(100);
  (void)two.set_light(change);
  EXPECT_EQ(one.status().light().brightness(), 100U);
  for (client::Client* client : {&one, &two}) {
    EXPECT_TRUE(read_until(*client, [](const Item& item) {
      const auto* event = std::get_if<v1::Event>(&item);
      return event != nullptr && event->light().brightness() == 100;
    }));
  }
  change.set_brightness(300);
  EXPECT_THROW((void)one.set_light(change), client::Refused);
}

}  // namespace
}  // namespace dtact::e2e
