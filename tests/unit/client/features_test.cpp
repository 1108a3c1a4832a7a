// Features that daemons announce, and requests that take long.
#include <gtest/gtest.h>

#include "clients/cpp/client.hpp"
#include "clients/cpp/session.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::client::test {
namespace {

// The daemon refuses after timeout_frames, which may be longer than other requests' timeout.
// takes.
TEST(Rezero, WaitsAsLongAsTheDaemonSays) {
  PlayedDaemon daemon({[](Peer& peer) {
    v1::Reply hello;
    hello.mutable_hello()->set_major(wire::kMajor);
    hello.mutable_hello()->set_rezero_timeout_s(kLong.count());
    (void)peer.answer(hello);
    const v1::ClientMessage request = peer.request();
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    v1::ServerMessage refused;
    refused.mutable_reply()->set_id(request.id());
    refused.mutable_reply()->mutable_error()->set_message("the picture is not still");
    peer.send(refused);
  }});
  daemon.options.timeout = std::chrono::milliseconds(200);
  Client client(daemon.options);
  EXPECT_THROW(client.rezero(), Refused);
}

// Before: over a slow network an upload ended with "takes no data".
TEST(Upload, HasLongerThanASmallRequest) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    std::this_thread::sleep_for(std::chrono::seconds(3));
    peer.done();
  }});
  daemon.options.timeout = std::chrono::seconds(2);
  Session session(daemon.options);
  v1::ClientMessage message;
  // More than the buffers of two sockets hold.
  message.mutable_upload_calibration()->mutable_reference_png()->resize(12'000'000, 'p');
  EXPECT_TRUE(session.request(message, daemon.options.timeout).has_done());
}

TEST(Features, PingAndReference) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet({"reference"});
    v1::Reply pong;
    pong.mutable_pong()->set_monotonic_ns(5);
    EXPECT_TRUE(peer.answer(pong).has_ping());
    v1::Reply reference;
    reference.mutable_reference()->set_png("png");
    EXPECT_TRUE(peer.answer(reference).has_get_reference());
    peer.refuse(v1::ERROR_DENIED, "this token may only view");
    peer.refuse(v1::ERROR_CONTACT, "there is contact");
  }});
  Client client(daemon.options);
  EXPECT_TRUE(client.has_feature("reference"));
  EXPECT_FALSE(client.has_feature("jpeg"));
  EXPECT_EQ(client.ping().monotonic_ns(), 5);
  EXPECT_EQ(client.reference().png(), "png");
  try {
    client.rezero();
    ADD_FAILURE();
  } catch (const Refused& e) {
    EXPECT_TRUE(e.denied());
    EXPECT_FALSE(e.is_transient());
  }
  try {
    client.rezero();
    ADD_FAILURE();
  } catch (const Refused& e) {
    EXPECT_FALSE(e.denied());
    EXPECT_TRUE(e.is_transient());
  }
}

}  // namespace
}  // namespace dtact::client::test
