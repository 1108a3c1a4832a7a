#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <memory>
#include <vector>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::HasSubstr;
using namespace std::string_literals;

v1::ClientMessage hello(std::uint32_t major) {
  v1::ClientMessage message;
  message.mutable_hello()->set_major(major);
  message.mutable_hello()->set_program("raw");
  return message;
}

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send and messages that are
// filled for constants
TEST(Handshake, ReportsVersionProgramAndSurfaceFrame) {
  NetConfig config;
  config.frame_id = "finger_3";
  const Rig rig(config);
  RawClient client(rig.tcp_port());
  const auto reply = client.request(hello(1));
  EXPECT_EQ(reply.id(), 1U);
  EXPECT_EQ(reply.hello().major(), 1U);
  EXPECT_EQ(reply.hello().program(), "dtactd 9.8.7");
  EXPECT_EQ(reply.hello().surface_frame().frame_id(), "finger_3");
  EXPECT_TRUE(reply.hello().surface_frame().right_handed());
  EXPECT_TRUE(reply.hello().surface_frame().mirrored_from_outside());
  EXPECT_EQ(reply.hello().surface_frame().origin(), "centre");
}

TEST(Handshake, ReportsHowLongARezeroMayTake) {
  Rig rig;
  pipeline::Status status;
  status.rezero_timeout_s = 11.5;
  rig.port.set_status(status);
  RawClient client(rig.tcp_port());
  EXPECT_EQ(client.request(hello(1)).hello().rezero_timeout_s(), 11.5);
}

TEST(Handshake, RefusesAnotherMajorVersionAndEnds) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  const auto reply = client.request(hello(2));
  EXPECT_EQ(reply.id(), 1U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_VERSION);
  EXPECT_THAT(reply.error().message(), HasSubstr("install the same release on both sides"));
  EXPECT_TRUE(client.ends());
}

// It has said Hello, so only the server's end of the connection limits how long it stays.
TEST(Handshake, DropsARefusedClientThatStays) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.send_bytes("\0\0\0\3\xff\xff\xff"s);
  EXPECT_EQ(client.reply().error().code(), v1::ERROR_BAD_MESSAGE);
  EXPECT_TRUE(client.ends());
  EXPECT_TRUE(client.is_dropped());
}

TEST(Handshake, WantsHelloFirst) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  v1::ClientMessage message;
  message.mutable_get_status();
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_VERSION);
  EXPECT_TRUE(client.ends());
}

TEST(Handshake, WantsHelloOnlyOnce) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(hello(1)).error().code(), v1::ERROR_INVALID);
  EXPECT_TRUE(client
                  .request([] {
                    v1::ClientMessage message;
                    message.mutable_get_status();
                    return message;
                  }())
                  .has_status());
}

TEST(Handshake, RefusesALongProgramName) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  auto message = hello(1);
  message.mutable_hello()->set_program(std::string(65, 'x'));
  EXPECT_EQ(client.request(message).error().code(), v1::ERROR_INVALID);
  message.mutable_hello()->set_program(std::string(64, 'x'));
  EXPECT_TRUE(client.request(message).has_hello());
}

TEST(Handshake, RefusesALongToken) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  auto message = hello(1);
  message.mutable_hello()->set_token(std::string(257, 'x'));
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_INVALID);
  EXPECT_THAT(reply.error().message(), HasSubstr("hello.token: 257 bytes, at most 256"));
  message.mutable_hello()->set_token(std::string(256, 'x'));
  EXPECT_TRUE(client.request(message).has_hello()) << "without a token file any token will do";
}

TEST(Handshake, EndsAfterSilence) {
  NetConfig config;
  config.hello_timeout = std::chrono::milliseconds(50);
  const Rig rig(config);
  RawClient client(rig.tcp_port());
  EXPECT_TRUE(client.ends());
}

TEST(Handshake, KeepsSilentClientsAfterHello) {
  NetConfig config;
  config.hello_timeout = std::chrono::seconds(1);
  const Rig rig(config);
  RawClient client(rig.tcp_port());
  client.hello();
  // A later client without Hello is dropped; the first one's time is over by then, too.
  RawClient silent(rig.tcp_port());
  EXPECT_TRUE(silent.ends());
  v1::ClientMessage message;
  message.mutable_get_status();
  EXPECT_TRUE(client.request(message).has_status());
}

TEST(Handshake, RefusesMoreThanMaxClients) {
  NetConfig config;
  config.max_clients = 1;
  Rig rig(config);
  auto first = std::make_unique<RawClient>(rig.tcp_port());
  first->hello();
  RawClient second(rig.tcp_port());
  const auto reply = second.say_hello();
  EXPECT_EQ(reply.id(), 0U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_BUSY);
  EXPECT_THAT(reply.error().message(), HasSubstr("max_clients"));
  EXPECT_TRUE(second.ends());

  first.reset();
  ASSERT_TRUE(rig.wait_log("the client left"));
  RawClient third(rig.tcp_port());
  EXPECT_NO_THROW(third.hello());
}

TEST(Malformed, IsAnsweredAndEnds) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.send_bytes("\0\0\0\3\xff\xff\xff"s);
  const auto reply = client.reply();
  EXPECT_EQ(reply.id(), 0U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_BAD_MESSAGE);
  EXPECT_TRUE(client.ends());
}

TEST(Malformed, EmptyMessagesAreNoRequests) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.send_bytes("\0\0\0\0"s);
  EXPECT_EQ(client.reply().error().code(), v1::ERROR_BAD_MESSAGE);
  EXPECT_TRUE(client.ends());
}

TEST(Malformed, IdZeroIsNotAllowed) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_get_status();
  client.send(message);
  const auto reply = client.reply();
  EXPECT_EQ(reply.error().code(), v1::ERROR_BAD_MESSAGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("ids begin with 1"));
  EXPECT_TRUE(client.ends());
}

TEST(Malformed, AnUnknownRequestIsAnsweredByItsId) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.send_bytes("\0\0\0\5\x08\x07\xfa\x01\x00"s);  // id 7, field 31 of a later version, empty
  const auto reply = client.reply();
  EXPECT_EQ(reply.id(), 7U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_UNSUPPORTED);
  EXPECT_THAT(reply.error().message(), HasSubstr("HelloReply.features"));
  v1::ClientMessage known;
  known.mutable_get_status();
  EXPECT_TRUE(client.request(known).has_status()) << "the connection stays";
}

TEST(Malformed, AnUnknownRequestIsNoHello) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.send_bytes("\0\0\0\5\x08\x07\xfa\x01\x00"s);
  EXPECT_EQ(client.reply().error().code(), v1::ERROR_VERSION);
  EXPECT_TRUE(client.ends());
}

TEST(Oversized, IsAnsweredAndEndsEvenWhileTheClientStillSends) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.send_bytes("\x01\x00\x00\x01"s);  // 16 MiB + 1
  client.send_bytes(std::string(1 << 20, 'x'));
  const auto reply = client.reply();
  EXPECT_EQ(reply.error().code(), v1::ERROR_TOO_LARGE);
  EXPECT_THAT(reply.error().message(), HasSubstr("16777217"));
  EXPECT_TRUE(client.ends());
}

TEST(Server, SaysWhoMayHaveThePort) {
  const Rig rig;
  boost::asio::io_context io;
  FakePort port;
  FakeStore store;
  NetConfig config;
  config.port = rig.tcp_port();
  try {
    const Server second(io, config, port, store);
    FAIL() << "two servers on one port";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("127.0.0.1 port " + std::to_string(rig.tcp_port())));
    EXPECT_THAT(e.what(), HasSubstr("another dtactd may be running"));
  }
}

TEST(Server, AcceptsAgainOnceThereAreDescriptors) {
  Rig rig;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit few = before;
  few.rlim_cur = 64;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
  std::vector<base::UniqueFd> taken;
  for (int fd = 0; (fd = ::dup(STDERR_FILENO)) >= 0;) taken.emplace_back(fd);
  ASSERT_FALSE(taken.empty());
  taken.pop_back();
  RawClient client(rig.tcp_port());  // takes the last one; the kernel connects it without accept()
  EXPECT_TRUE(rig.wait_log("cannot accept clients"));
  taken.clear();
  EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_NO_THROW(client.hello());
}

// The side that closes a connection keeps its port for a minute.
TEST(Server, StartsAgainThoughItEndedConnections) {
  auto rig = std::make_unique<Rig>();
  NetConfig config;
  config.port = rig->tcp_port();
  RawClient client(config.port);
  client.hello();
  rig.reset();
  EXPECT_TRUE(client.ends());
  boost::asio::io_context io;
  FakePort port;
  FakeStore store;
  EXPECT_NO_THROW(Server(io, config, port, store));
}

TEST(Server, RefusesWhatIsNoAddress) {
  boost::asio::io_context io;
  FakePort port;
  FakeStore store;
  NetConfig config;
  config.address = "localhost:7";
  EXPECT_THROW(Server(io, config, port, store), std::runtime_error);
}

TEST(Server, ListensOnIpv6) {
  boost::asio::io_context io;
  FakePort port;
  FakeStore store;
  NetConfig config;
  config.address = "::1";
  config.port = 0;
  try {
    const Server server(io, config, port, store);
    EXPECT_NE(server.port(), 0);
  } catch (const std::runtime_error& e) {
    GTEST_SKIP() << "this machine has no IPv6 loopback: " << e.what();
  }
}

TEST(Server, EndsItsConnectionsAndItsWork) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  rig.stop();  // returns only when the loop has nothing left to do
  EXPECT_TRUE(client.ends());
  EXPECT_TRUE(rig.port.wait_wanted({}));
}

// NOLINTEND(misc-const-correctness)

}  // namespace
}  // namespace dtact::net::test
