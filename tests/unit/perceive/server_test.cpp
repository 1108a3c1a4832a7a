// dtact-perceive's server with a daemon that a test plays, or with none.
#include "clients/perceive/server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <sstream>
#include <string>
#include <thread>

#include "clients/cpp/client.hpp"
#include "clients/perceive/perceive.hpp"
#include "tests/fakes/perceive_server.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::perceive {
namespace {

using client::test::kLong;
using client::test::Peer;
using client::test::PlayedDaemon;
using fakes::PerceiveServer;
using testing::HasSubstr;

/// The first status for which `done` is true; after kLong the last one.
v1::Status status_when(client::Client& client, const std::function<bool(const v1::Status&)>& done) {
  const auto end = std::chrono::steady_clock::now() + kLong;
  for (;;) {
    v1::Status status = client.status();
    if (done(status) || std::chrono::steady_clock::now() > end) return status;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}
bool serves(const v1::Status& status) { return status.state() == v1::STATE_SERVING; }

void greet(Peer& peer) {
  v1::Reply reply;
  v1::HelloReply& hello = *reply.mutable_hello();
  hello.set_major(wire::kMajor);
  hello.set_program("dtactd 9.8.7");
  hello.set_name("left");
  hello.set_serial("S7");
  hello.mutable_surface_frame()->set_frame_id("left_finger");
  peer.answer(std::move(reply));
}

TEST(Server, SaysThatTheDaemonIsAway) {
  client::Options nobody;
  {
    const PlayedDaemon gone({});
    nobody = gone.options;
  }
  const PerceiveServer server(nobody);
  client::Client client = server.connect();
  const v1::Status status = status_when(
      client, [](const v1::Status& one) { return one.advice().find("yet") == std::string::npos; });
  EXPECT_NE(status.state(), v1::STATE_SERVING);
  EXPECT_THAT(status.advice(), HasSubstr(std::to_string(nobody.port)));
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run({"--port", std::to_string(server.port()), "watch", "--seconds", "4"}, out, error),
            0)
      << error.str();
  EXPECT_THAT(out.str(), HasSubstr("no frames: " + status.advice() + "\n"));
}

TEST(Server, IntroducesItselfWithTheDaemonsNameAndFrame) {
  PlayedDaemon daemon({[](Peer& peer) {
    greet(peer);
    for (;;) peer.done();
  }});
  const PerceiveServer server(daemon.options);
  client::Client first = server.connect();
  const v1::Status status = status_when(first, serves);
  EXPECT_EQ(status.state(), v1::STATE_SERVING);
  EXPECT_EQ(status.advice(), "");
  EXPECT_EQ(status.name(), "left");
  EXPECT_EQ(status.serial(), "S7");
  const client::Client client = server.connect();
  EXPECT_EQ(client.server().surface_frame().frame_id(), "left_finger");
  EXPECT_EQ(client.server().name(), "left");
  EXPECT_EQ(client.server().serial(), "S7");
}

TEST(Server, LogsFramesThatItCannotReadOnce) {
  constexpr std::uint64_t kFrames = 3;
  std::atomic<std::uint64_t> wanted = 1;
  PlayedDaemon daemon({[&wanted](Peer& peer) {
    greet(peer);
    peer.done();  // of nothing, as no client is there
    peer.done();  // of the client
    for (std::uint64_t sequence = 1; sequence <= kFrames; ++sequence) {
      while (wanted < sequence) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      v1::ServerMessage message;
      v1::Frame& frame = *message.mutable_frame();
      frame.set_sequence(sequence);
      frame.mutable_contact()->set_in_contact(false);
      frame.mutable_depth();
      frame.mutable_surface()->set_shape(static_cast<v1::Surface::Shape>(9));
      peer.send(message);
    }
    for (;;) peer.done();  // a subscription may come twice
  }});
  const PerceiveServer server(daemon.options);
  client::Client client = server.connect();
  (void)status_when(client, serves);
  v1::Subscribe summary;
  summary.set_summary(true);
  client.subscribe(summary);
  v1::Status status;
  for (std::uint64_t taken = 1; taken <= kFrames; ++taken) {
    // One after the other, since a newer frame replaces one that waits.
    status = status_when(client, [=](const v1::Status& one) { return one.frames() >= taken; });
    wanted = taken + 1;
  }
  EXPECT_EQ(status.frames(), kFrames);
  EXPECT_THAT(status.advice(), HasSubstr("a shape, 9,"));
  EXPECT_NE(status.state(), v1::STATE_SERVING);
  const std::string log = server.log();
  const std::size_t first = log.find("a shape, 9,");
  EXPECT_NE(first, std::string::npos) << log;
  EXPECT_EQ(log.find("a shape, 9,", first + 1), std::string::npos) << log;
}

}  // namespace
}  // namespace dtact::perceive
