#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "proto/depth_encoding.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::Each;
using testing::HasSubstr;

v1::ClientMessage get_status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return message;
}

/// Kernel buffer of a client that is to be slow. A frame of 800×600 is far larger.
constexpr int kSmallBuffer = 16 * 1024;

TEST(Stream, CarriesDepthAndLuma) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16, v1::LUMA_GREY8);
  rig.port.publish(make_frame(5, 8, 4));
  const auto frame = client.frame();
  EXPECT_EQ(frame.sequence(), 5U);
  EXPECT_EQ(frame.frame_id(), "dtact_surface");
  EXPECT_EQ(frame.dropped(), 0U);
  EXPECT_EQ(frame.depth().encoding(), v1::DEPTH_INT16);
  EXPECT_EQ(frame.depth().width(), 8U);
  EXPECT_EQ(frame.depth().height(), 4U);
  EXPECT_EQ(frame.depth().mm_per_px(), 0.05);
  EXPECT_EQ(frame.depth().um_per_unit(), 1.0);
  EXPECT_EQ(frame.depth().untrusted_value(), -32768);
  std::vector<std::int16_t> depth;
  ASSERT_TRUE(wire::decode_int16(frame.depth().data(), 8, 4, depth));
  EXPECT_THAT(depth, Each(5));
  EXPECT_EQ(frame.luma().data(), std::string(32, '\5'));
}

TEST(Stream, EncodesWhatEachClientAskedFor) {
  Rig rig;
  RawClient small(rig.tcp_port());
  RawClient luma(rig.tcp_port());
  RawClient summary(rig.tcp_port());
  small.hello();
  luma.hello();
  summary.hello();
  small.subscribe(v1::DEPTH_DELTA_ZSTD);
  luma.subscribe(v1::DEPTH_NONE, v1::LUMA_GREY8);
  summary.subscribe(v1::DEPTH_INT16, v1::LUMA_GREY8, 1, true);
  auto published = make_frame(7);
  published.contact.touching = true;
  published.contact.area_mm2 = 12.5;
  rig.port.publish(published);

  auto frame = small.frame();
  std::vector<std::int16_t> depth;
  ASSERT_TRUE(wire::decode_delta_zstd(frame.depth().data(), 8, 4, depth));
  EXPECT_THAT(depth, Each(7));
  EXPECT_FALSE(frame.has_luma());
  frame = luma.frame();
  EXPECT_FALSE(frame.has_depth());
  EXPECT_EQ(frame.luma().data().size(), 32U);
  frame = summary.frame();
  EXPECT_FALSE(frame.has_depth());
  EXPECT_FALSE(frame.has_luma());
  EXPECT_EQ(frame.contact().area_mm2(), 12.5);
}

TEST(Stream, EncodesOnceForSixtyFourClients) {
  NetConfig config;
  config.max_clients = 64;
  Rig rig(config);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 64; ++i) {
    clients.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    clients.back()->hello();
    clients.back()->subscribe(v1::DEPTH_DELTA_ZSTD);
  }
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    rig.port.publish(make_frame(sequence));
    for (const auto& client : clients) ASSERT_EQ(client->frame().sequence(), sequence);
  }
  const auto status = clients.front()->request(get_status()).status();
  EXPECT_EQ(status.encoded(), 3U);
  ASSERT_EQ(status.stages_size(), 2);
  EXPECT_EQ(status.stages(0).stage(), "handover");
  EXPECT_EQ(status.stages(1).stage(), "encode");
  EXPECT_GT(status.stages(1).p50_us(), 0.0);
}

TEST(Stream, LeavesDepthOutWhenThereIsNone) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16, v1::LUMA_GREY8);
  auto published = make_frame(1);
  published.has_depth = false;
  rig.port.publish(published);
  const auto frame = client.frame();
  EXPECT_FALSE(frame.has_depth());
  EXPECT_TRUE(frame.has_luma());
}

TEST(Stream, TellsThePipelineTheUnionOfWhatIsWanted) {
  Rig rig;
  ASSERT_TRUE(rig.port.wait_wanted({}));
  auto depth = std::make_unique<RawClient>(rig.tcp_port());
  RawClient luma(rig.tcp_port());
  depth->hello();
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true}));
  luma.hello();
  depth->subscribe(v1::DEPTH_DELTA_ZSTD);
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true, .depth = true}));
  luma.subscribe(v1::DEPTH_NONE, v1::LUMA_GREY8);
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true, .depth = true, .luma = true}));
  depth.reset();
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true, .luma = true}));
  luma.subscribe(v1::DEPTH_NONE, v1::LUMA_NONE, 1, true);
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true, .depth = true}));
  luma.subscribe(v1::DEPTH_NONE);
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true}));
}

TEST(Stream, GivesEveryNthFrame) {
  Rig rig;
  RawClient all(rig.tcp_port());
  RawClient third(rig.tcp_port());
  all.hello();
  third.hello();
  all.subscribe(v1::DEPTH_INT16);
  third.subscribe(v1::DEPTH_INT16, v1::LUMA_NONE, 3);
  for (std::uint64_t sequence = 1; sequence <= 7; ++sequence) {
    rig.port.publish(make_frame(sequence));
    ASSERT_EQ(all.frame().sequence(), sequence);
  }
  for (const std::uint64_t sequence : {1U, 4U, 7U}) {
    const auto frame = third.frame();
    EXPECT_EQ(frame.sequence(), sequence);
    EXPECT_EQ(frame.dropped(), 0U);  // what was not asked for is not missed
  }
}

TEST(Stream, ANewSubscriptionBeginsWithTheNextFrame) {
  Rig rig;
  RawClient all(rig.tcp_port());
  RawClient third(rig.tcp_port());
  all.hello();
  third.hello();
  all.subscribe(v1::DEPTH_INT16);
  third.subscribe(v1::DEPTH_INT16, v1::LUMA_NONE, 3);
  const auto publish = [&](std::uint64_t sequence) {
    rig.port.publish(make_frame(sequence));
    ASSERT_EQ(all.frame().sequence(), sequence);
  };
  publish(1);
  publish(2);
  EXPECT_EQ(third.frame().sequence(), 1U);
  third.subscribe(v1::DEPTH_INT16, v1::LUMA_NONE, 3);
  for (const std::uint64_t sequence : {3U, 4U, 5U, 6U}) publish(sequence);
  EXPECT_EQ(third.frame().sequence(), 3U);
  EXPECT_EQ(third.frame().sequence(), 6U);
}

TEST(Stream, CountsWhatThePipelineSkippedAsMissed) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  auto frame = make_frame(1);
  frame.skipped = 40;  // before this client was there
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().dropped(), 0U);
  frame = make_frame(5);
  frame.skipped = 43;
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().dropped(), 3U);
}

TEST(Stream, OfEveryNthFrameOnlyThoseWantedAreMissed) {
  Rig rig;
  RawClient third(rig.tcp_port());
  RawClient all(rig.tcp_port());
  all.hello();
  third.hello();
  all.subscribe(v1::DEPTH_INT16);
  third.subscribe(v1::DEPTH_INT16, v1::LUMA_NONE, 3);
  std::uint64_t skipped = 0;
  const auto publish = [&](std::uint64_t sequence, std::uint64_t missed) {
    auto frame = make_frame(sequence);
    frame.skipped = skipped += missed;
    rig.port.publish(frame);
    ASSERT_EQ(all.frame().sequence(), sequence);
  };
  // Of the frames 0, 1, 2, ... it is to get 0, 3, 6, 9.
  publish(0, 0);
  EXPECT_EQ(third.frame().dropped(), 0U);
  publish(3, 2);
  auto frame = third.frame();
  EXPECT_EQ(frame.sequence(), 3U);
  EXPECT_EQ(frame.dropped(), 0U);
  publish(7, 3);
  publish(8, 0);
  publish(9, 0);
  frame = third.frame();
  EXPECT_EQ(frame.sequence(), 9U);
  EXPECT_EQ(frame.dropped(), 1U);
}

TEST(Stream, SendsEventsToEveryoneGreeted) {
  Rig rig;
  RawClient subscribed(rig.tcp_port());
  RawClient idle(rig.tcp_port());
  subscribed.hello();
  idle.hello();
  subscribed.subscribe(v1::DEPTH_INT16);
  pipeline::ContactChanged made;
  made.touching = true;
  made.at = {11, 12, 13};
  made.contact.deepest_mm = 0.5;
  rig.port.emit(made);
  rig.port.emit(pipeline::ReferenceTaken{true, {.sequence = 13}});
  pipeline::StateChanged state{pipeline::State::serving, {}};
  state.health.set(pipeline::Health::reference_restored);
  rig.port.emit(state);
  for (auto* client : {&subscribed, &idle}) {
    auto event = client->event();
    EXPECT_TRUE(event.contact().contact().touching());
    EXPECT_EQ(event.contact().sequence(), 11U);
    EXPECT_EQ(event.contact().monotonic_ns(), 12);
    EXPECT_EQ(event.contact().contact().deepest_mm(), 0.5);
    event = client->event();
    EXPECT_EQ(event.reference().sequence(), 13U);
    EXPECT_TRUE(event.reference().restored());
    event = client->event();
    EXPECT_EQ(event.state().state(), v1::STATE_SERVING);
    ASSERT_EQ(event.state().health_size(), 1);
    EXPECT_EQ(event.state().health(0), v1::HEALTH_REFERENCE_RESTORED);
  }
}

// The newest frame wins and the rest is counted; an answer goes before the waiting frame.
TEST(Stream, AnAnswerWaitsForTheFrameBeingSentAndNoOther) {
  Rig rig;
  RawClient slow(rig.tcp_port(), kSmallBuffer);
  slow.hello();
  slow.subscribe(v1::DEPTH_INT16);
  for (std::uint64_t sequence = 1; sequence <= 10; ++sequence) {
    rig.port.publish(make_frame(sequence, 800, 600));
    ASSERT_TRUE(rig.port.wait_fetched());
  }
  auto request = get_status();
  request.set_id(77);
  slow.send(request);
  ASSERT_TRUE(rig.port.wait_status_calls(1));

  auto message = slow.receive();
  ASSERT_TRUE(message.has_value() && message->has_frame());
  EXPECT_EQ(message->frame().sequence(), 1U);
  message = slow.receive();
  ASSERT_TRUE(message.has_value() && message->has_reply());
  EXPECT_EQ(message->reply().id(), 77U);
  message = slow.receive();
  ASSERT_TRUE(message.has_value() && message->has_frame());
  EXPECT_EQ(message->frame().sequence(), 10U);
  EXPECT_EQ(message->frame().dropped(), 8U);
}

TEST(Stream, OneThatNeverReadsDelaysNobody) {
  Rig rig;
  RawClient dead(rig.tcp_port(), kSmallBuffer);
  dead.hello();
  dead.subscribe(v1::DEPTH_INT16);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 15; ++i) {
    clients.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    clients.back()->hello();
    clients.back()->subscribe(i % 2 == 0 ? v1::DEPTH_INT16 : v1::DEPTH_DELTA_ZSTD);
  }
  constexpr std::uint64_t kFrames = 30;
  for (std::uint64_t sequence = 1; sequence <= kFrames; ++sequence) {
    rig.port.publish(make_frame(sequence, 800, 600));
    for (auto& client : clients) {
      const auto frame = client->frame();
      ASSERT_EQ(frame.sequence(), sequence);
      ASSERT_EQ(frame.dropped(), 0U);
    }
    if (sequence % 10 == 0) {
      ASSERT_TRUE(clients[sequence / 10]->request(get_status()).has_status());
    }
  }
  const auto status = clients[0]->request(get_status()).status();
  ASSERT_EQ(status.clients_size(), 16);
  // The first frame is stuck in its socket, the last one waits.
  EXPECT_EQ(status.clients(0).sent(), 0U);
  EXPECT_EQ(status.clients(0).dropped(), kFrames - 2);
  for (int i = 1; i < 16; ++i) {
    EXPECT_EQ(status.clients(i).sent(), kFrames);
    EXPECT_EQ(status.clients(i).dropped(), 0U);
  }
}

TEST(Stream, SurvivesAClientKilledInTheMiddleOfAFrame) {
  Rig rig;
  RawClient victim(rig.tcp_port(), kSmallBuffer);
  RawClient other(rig.tcp_port());
  victim.hello();
  other.hello();
  victim.subscribe(v1::DEPTH_INT16);
  other.subscribe(v1::DEPTH_INT16);
  rig.port.publish(make_frame(1, 800, 600));
  EXPECT_EQ(other.frame().sequence(), 1U);
  victim.die();
  for (std::uint64_t sequence = 2; sequence <= 5; ++sequence) {
    rig.port.publish(make_frame(sequence, 800, 600));
    EXPECT_EQ(other.frame().sequence(), sequence);
  }
  ASSERT_TRUE(rig.wait_log("disconnected"));
  EXPECT_EQ(other.request(get_status()).status().clients_size(), 1);
}

/// Asks for a calibration of a mebibyte.
v1::ClientMessage get_large(Rig& rig, RawClient& client) {
  v1::ClientMessage message;
  auto& upload = *message.mutable_upload_calibration();
  upload.set_name("large");
  upload.set_calibration_toml("toml");
  upload.set_reference_png(std::string(1U << 20U, 'x'));
  const std::uint64_t number = client.request(message).done().calibration();
  EXPECT_EQ(number, *rig.store.current_number());
  message.mutable_get_calibration()->set_number(number);
  return message;
}

TEST(Stream, WhatAClientHasReadIsNotUnread) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  const auto get = get_large(rig, client);
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(client.request(get).calibration().reference_png().size(), 1U << 20U) << i;
  }
}

TEST(Stream, LetsAClientGoThatLeavesMegabytesUnread) {
  Rig rig({}, answer_done);
  RawClient deaf(rig.tcp_port(), kSmallBuffer);
  deaf.hello();
  auto get = get_large(rig, deaf);
  for (std::uint64_t id = 100; id < 112; ++id) {
    get.set_id(id);
    deaf.send(get);
  }
  EXPECT_TRUE(rig.wait_log(" answers and events ("));
  EXPECT_THAT(rig.log(), HasSubstr("bytes) lay unread"));
  EXPECT_TRUE(deaf.ends());
}

TEST(Stream, SaysOnceThatFramesAreTooLarge) {
  Rig rig;
  RawClient client(rig.tcp_port());
  RawClient summary(rig.tcp_port());
  client.hello();
  summary.hello();
  client.subscribe(v1::DEPTH_NONE, v1::LUMA_GREY8);
  summary.subscribe(v1::DEPTH_NONE, v1::LUMA_NONE, 1, true);
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    auto frame = make_frame(sequence);
    frame.luma_width = 4096;
    frame.luma_height = 4096;
    frame.luma.resize(16U << 20U);
    rig.port.publish(frame);
    EXPECT_EQ(summary.frame().sequence(), sequence);
  }
  const std::string log = rig.log();
  const std::size_t told = log.find("above the wire's cap");
  ASSERT_NE(told, std::string::npos);
  EXPECT_EQ(log.find("above the wire's cap", told + 1), std::string::npos);
}

TEST(Stream, LetsAClientGoThatLeavesEventsUnread) {
  Rig rig;
  RawClient deaf(rig.tcp_port(), kSmallBuffer);
  deaf.hello();
  RawClient other(rig.tcp_port());
  other.hello();
  int read = 0;
  for (int i = 1; i <= 60'000 && rig.log().find("lay unread") == std::string::npos; ++i) {
    rig.port.emit(pipeline::ReferenceTaken{false, {.sequence = static_cast<std::uint64_t>(i)}});
    EXPECT_EQ(other.event().reference().sequence(), static_cast<std::uint64_t>(i));
    ++read;
  }
  EXPECT_THAT(rig.log(), HasSubstr("1024 answers and events"));
  EXPECT_GT(read, 1024);
  EXPECT_TRUE(deaf.ends());
  EXPECT_EQ(other.request(get_status()).status().clients_size(), 1);
}

}  // namespace
}  // namespace dtact::net::test
