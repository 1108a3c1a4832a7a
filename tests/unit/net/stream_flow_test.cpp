// Rates, and clients that read slowly, partly or not at all.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::HasSubstr;

/// Kernel buffer of a client that is to be slow. A frame of 800×600 is far larger.
constexpr int kSmallBuffer = 16 * 1024;

// The newest frame wins and the others are counted; an answer goes before the waiting frame.
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
    clients.back()->subscribe(i % 2 == 0 ? v1::DEPTH_INT16 : v1::DEPTH_PREDICT_ZSTD);
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

/// Requests a calibration of `bytes` that was uploaded before.
v1::ClientMessage get_large(Rig& rig, RawClient& client, std::size_t bytes) {
  v1::ClientMessage message;
  auto& upload = *message.mutable_upload_calibration();
  upload.set_name("large");
  upload.set_calibration_toml("toml");
  upload.set_reference_png(std::string(bytes, 'x'));
  const std::uint64_t number = client.request(message).done().calibration();
  EXPECT_EQ(number, *rig.store.current_number());
  message.mutable_get_calibration()->set_number(number);
  return message;
}

TEST(Stream, WhatAClientHasReadIsNotUnread) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  const auto get = get_large(rig, client, 1U << 20U);
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(client.request(get).calibration().reference_png().size(), 1U << 20U) << i;
  }
}

TEST(Stream, LetsAClientGoThatLeavesMegabytesUnread) {
  Rig rig({}, answer_done);
  RawClient deaf(rig.tcp_port(), kSmallBuffer);
  deaf.hello();
  auto get = get_large(rig, deaf, 1U << 20U);
  for (std::uint64_t id = 100; id < 112; ++id) {
    get.set_id(id);
    deaf.send(get);
  }
  EXPECT_TRUE(rig.wait_log(" answers and events ("));
  EXPECT_THAT(rig.log(), HasSubstr("bytes) lay unread"));
  EXPECT_TRUE(deaf.ends());
}

// Before: the event ended the connection, and the answer was lost.
TEST(Stream, KeepsAClientThatReadsALargeAnswerWhileAnEventComes) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port(), kSmallBuffer);
  client.hello();
  RawClient other(rig.tcp_port());
  other.hello();
  auto get = get_large(rig, client, 6U << 20U);
  get.set_id(100);
  client.send(get);
  const auto waiting = [&] {
    std::uint64_t most = 0;
    const v1::Reply reply = other.request(get_status());
    for (const auto& about : reply.status().clients()) {
      most = std::max(most, about.waiting_bytes());
    }
    return most;
  };
  while (waiting() < (5U << 20U)) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  rig.port.emit(pipeline::ReferenceTaken{false, {.sequence = 77}});
  EXPECT_EQ(other.event().reference().sequence(), 77U);
  EXPECT_EQ(client.reply().calibration().reference_png().size(), 6U << 20U);
  EXPECT_EQ(client.event().reference().sequence(), 77U);
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

/// The n-th frame of a camera of 60 frames a second.
pipeline::DepthFrame timed(std::uint64_t n) {
  auto frame = make_frame(n);
  frame.camera.timestamp_ns = 1'000'000'000 + static_cast<std::int64_t>(n) * 16'666'667;
  return frame;
}

TEST(Stream, SendsEachPartAtTheRateThatIsAskedFor) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = subscribe();
  message.mutable_subscribe()->set_depth(v1::DEPTH_PREDICT_ZSTD);
  message.mutable_subscribe()->set_depth_hz(30);
  message.mutable_subscribe()->set_luma(v1::LUMA_GREY8);
  message.mutable_subscribe()->set_luma_hz(15);
  ASSERT_TRUE(client.request(message).has_done());
  RawClient all(rig.tcp_port());
  all.hello();
  all.subscribe(v1::DEPTH_NONE, v1::LUMA_NONE, 1, true);
  std::vector<std::uint64_t> depth;
  std::vector<std::uint64_t> luma;
  for (std::uint64_t n = 0; n < 9; ++n) {
    rig.port.publish(timed(n));
    ASSERT_EQ(all.frame().sequence(), n);
    if (n % 2 != 0) continue;
    const auto frame = client.frame();
    ASSERT_EQ(frame.sequence(), n);
    if (frame.has_depth()) depth.push_back(n);
    if (frame.has_luma()) luma.push_back(n);
  }
  EXPECT_EQ(depth, (std::vector<std::uint64_t>{0, 2, 4, 6, 8}));
  EXPECT_EQ(luma, (std::vector<std::uint64_t>{0, 4, 8}));
}

// A part with a rate of its own is due once; replacing the frame must not lose the part.
TEST(Stream, ANewerFrameHoldsWhatWasDueOfTheOneItReplaces) {
  Rig rig;
  RawClient slow(rig.tcp_port(), kSmallBuffer);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_major(1);
  ASSERT_TRUE(slow.request(hello).has_hello());
  auto message = subscribe();
  message.mutable_subscribe()->set_summary(true);
  message.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  message.mutable_subscribe()->set_luma(v1::LUMA_GREY8);
  message.mutable_subscribe()->set_luma_hz(1);
  ASSERT_TRUE(slow.request(message).has_done());
  for (const std::uint64_t n : {0U, 60U, 61U, 62U}) {  // luma is due with 0 and 60
    auto frame = make_frame(n, 800, 600);
    frame.camera.timestamp_ns = timed(n).camera.timestamp_ns;
    rig.port.publish(frame);
    ASSERT_TRUE(rig.port.wait_fetched());
  }
  EXPECT_TRUE(slow.frame().has_luma());
  const auto last = slow.frame();
  EXPECT_EQ(last.sequence(), 62U);
  EXPECT_TRUE(last.has_luma());
  EXPECT_EQ(last.dropped(), 2U);
}

TEST(Stream, APingIsAnsweredBeforeAllThatWaits) {
  Rig rig;
  RawClient slow(rig.tcp_port(), kSmallBuffer);
  slow.hello();
  slow.subscribe(v1::DEPTH_INT16);
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    rig.port.publish(make_frame(sequence, 800, 600));
    ASSERT_TRUE(rig.port.wait_fetched());
  }
  auto request = get_status();
  for (const std::uint64_t id : {50U, 51U}) {
    request.set_id(id);
    slow.send(request);
  }
  v1::ClientMessage ping;
  ping.set_id(52);
  ping.mutable_ping();
  slow.send(ping);
  request.set_id(53);
  slow.send(request);
  ASSERT_TRUE(rig.port.wait_status_calls(5));  // one for each Hello, subscription and status
  std::vector<std::uint64_t> order;
  for (int i = 0; i < 6; ++i) {
    const auto message = slow.receive();
    ASSERT_TRUE(message.has_value());
    order.push_back(message->has_reply() ? message->reply().id() : message->frame().sequence());
  }
  EXPECT_EQ(order, (std::vector<std::uint64_t>{1, 52, 50, 51, 53, 3}));
}

}  // namespace
}  // namespace dtact::net::test
