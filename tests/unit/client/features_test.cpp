// What daemons of version 1.1 can do, and that older ones are not asked for it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "clients/cpp/client.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::client::test {
namespace {

using testing::HasSubstr;

struct Part {
  std::string feature;
  std::function<void(v1::Subscribe&)> ask;
};

std::vector<Part> parts() {
  return {{"jpeg", [](v1::Subscribe& s) { s.set_jpeg(true); }},
          {"rates", [](v1::Subscribe& s) { s.set_depth_hz(1); }},
          {"rates", [](v1::Subscribe& s) { s.set_luma_hz(1); }},
          {"rates", [](v1::Subscribe& s) { s.set_jpeg_hz(1); }},
          {"rates", [](v1::Subscribe& s) { s.set_summary_hz(1); }},
          {"decimation", [](v1::Subscribe& s) { s.set_decimation(2); }},
          {"units", [](v1::Subscribe& s) { s.set_um_per_unit(5); }},
          {"region", [](v1::Subscribe& s) { s.mutable_box(); }},
          {"region", [](v1::Subscribe& s) { s.set_contact_box(true); }},
          {"events", [](v1::Subscribe& s) { s.set_events(false); }}};
}

TEST(Features, AnOlderDaemonIsNotAskedForWhatItDoesNotKnow) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    // The first that comes.
    EXPECT_TRUE(peer.done().has_subscribe());
  }});
  Client client(daemon.options);
  for (const Part& part : parts()) {
    v1::Subscribe subscription;
    part.ask(subscription);
    try {
      client.subscribe(subscription);
      ADD_FAILURE() << part.feature;
    } catch (const Refused& e) {
      EXPECT_TRUE(e.unsupported());
      EXPECT_THAT(e.what(), HasSubstr('"' + part.feature + '"'));
      EXPECT_THAT(e.what(), HasSubstr("dtactd 9.8.7"));
    }
  }
  EXPECT_THROW((void)client.ping(), Refused);
  EXPECT_THROW((void)client.reference(), Refused);
  // Fields at the values that 1.0 has anyway.
  v1::Subscribe plain = depth_stream();
  plain.set_decimation(1);
  plain.set_um_per_unit(1);
  plain.set_events(true);
  client.subscribe(plain);
}

TEST(Features, ADaemonThatListsThemIsAsked) {
  for (const Part& part : parts()) {
    v1::Subscribe seen;
    PlayedDaemon daemon({[&](Peer& peer) {
      peer.greet({"other", part.feature});
      seen = peer.done().subscribe();
    }});
    Client client(daemon.options);
    v1::Subscribe subscription;
    part.ask(subscription);
    client.subscribe(subscription);
    daemon.finish();
    EXPECT_EQ(seen.SerializeAsString(), subscription.SerializeAsString());
  }
}

// The daemon's refusal comes after patience_frames, which may be longer than any other answer
// takes.
TEST(Rezero, WaitsAsLongAsTheDaemonSays) {
  PlayedDaemon daemon({[](Peer& peer) {
    v1::Reply hello;
    hello.mutable_hello()->set_major(wire::kMajor);
    hello.mutable_hello()->set_rezero_within_s(kLong.count());
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

TEST(Features, PingAndReference) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet({"ping", "reference"});
    v1::Reply pong;
    pong.mutable_pong()->set_monotonic_ns(5);
    EXPECT_TRUE(peer.answer(pong).has_ping());
    v1::Reply reference;
    reference.mutable_reference()->set_png("png");
    EXPECT_TRUE(peer.answer(reference).has_get_reference());
    peer.refuse(v1::ERROR_DENIED, "this token may only view");
    peer.refuse(v1::ERROR_CONTACT, "something touches");
  }});
  Client client(daemon.options);
  EXPECT_TRUE(client.has_feature("ping"));
  EXPECT_FALSE(client.has_feature("jpeg"));
  EXPECT_EQ(client.ping().monotonic_ns(), 5);
  EXPECT_EQ(client.reference().png(), "png");
  try {
    client.rezero();
    ADD_FAILURE();
  } catch (const Refused& e) {
    EXPECT_TRUE(e.denied());
    EXPECT_FALSE(e.worth_repeating());
  }
  try {
    client.rezero();
    ADD_FAILURE();
  } catch (const Refused& e) {
    EXPECT_FALSE(e.denied());
    EXPECT_TRUE(e.worth_repeating());
  }
}

}  // namespace
}  // namespace dtact::client::test
