// A frame is cut out of the daemon's message without parsing it.
#include <gtest/gtest.h>

#include "clients/web/relayed_frame.hpp"
#include "proto/dtact.pb.h"

namespace dtact::web {
namespace {

v1::ServerMessage message() {
  v1::ServerMessage made;
  auto& frame = *made.mutable_frame();
  frame.set_sequence(7);
  frame.set_monotonic_ns(-3);
  frame.set_wall_ns(1'700'000'000'000'000'000);
  frame.add_health(v1::HEALTH_STARTING);
  frame.mutable_depth()->set_data(std::string(300, '\x68'));  // 0x68 is the tag of `dropped`
  frame.set_frame_id("dtact_surface");
  return made;
}

TEST(Relay, KeepsTheFrameByteForByte) {
  const v1::ServerMessage sent = message();
  const auto got = relay(sent.SerializeAsString());
  ASSERT_TRUE(got);
  EXPECT_EQ(got->encoded->body, sent.frame().SerializeAsString());
  EXPECT_EQ(got->monotonic_ns, -3);
  EXPECT_EQ(got->dropped, 0U);
  EXPECT_EQ(got->parts, 1U << 11U) << "depth alone";
}

TEST(Relay, TakesOutWhatTheGatewayMissed) {
  v1::ServerMessage sent = message();
  const std::string without = sent.frame().SerializeAsString();
  sent.mutable_frame()->set_dropped(300);
  const auto got = relay(sent.SerializeAsString());
  ASSERT_TRUE(got);
  EXPECT_EQ(got->dropped, 300U);
  EXPECT_EQ(got->encoded->body, without);
}

TEST(Relay, TakesItFromTheEndWhereDaemonsPutIt) {
  const std::string body = message().frame().SerializeAsString();
  v1::Frame dropped;
  dropped.set_dropped(5);
  v1::ServerMessage sent;
  ASSERT_TRUE(sent.mutable_frame()->ParseFromString(body));
  // ServerMessage.frame, its length in two bytes, the body and `dropped` behind it.
  const std::string whole = body + dropped.SerializeAsString();
  std::string bytes{'\x12', static_cast<char>(0x80U | (whole.size() & 0x7fU)),
                    static_cast<char>(whole.size() >> 7U)};
  const auto got = relay(bytes + whole);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->dropped, 5U);
  EXPECT_EQ(got->encoded->body, body);
}

TEST(Relay, NamesTheParts) {
  v1::ServerMessage sent;
  sent.mutable_frame()->mutable_luma();
  sent.mutable_frame()->mutable_jpeg();
  sent.mutable_frame()->mutable_cloud();
  EXPECT_EQ(relay(sent.SerializeAsString())->parts, 1U << 12U | 1U << 17U | 1U << 21U);
}

TEST(Relay, AnswersAndEventsAreNone) {
  v1::ServerMessage sent;
  sent.mutable_reply()->set_id(1);
  EXPECT_FALSE(relay(sent.SerializeAsString()));
  sent.mutable_event()->mutable_light();
  EXPECT_FALSE(relay(sent.SerializeAsString()));
  EXPECT_FALSE(relay(""));
}

TEST(Relay, RefusesWhatEndsTooEarly) {
  const std::string bytes = message().SerializeAsString();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(relay(bytes.substr(0, size))) << size;
  }
  EXPECT_FALSE(relay(bytes + '\0'));
}

}  // namespace
}  // namespace dtact::web
