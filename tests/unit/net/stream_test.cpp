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
  config.max_clients_per_address = 64;
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
    EXPECT_EQ(event.sequence(), 11U);
    EXPECT_EQ(event.monotonic_ns(), 12);
    EXPECT_EQ(event.wall_ns(), 13);
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

v1::ClientMessage subscribe() {
  v1::ClientMessage message;
  message.mutable_subscribe();
  return message;
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

// A part with a rate of its own is due once; that the frame gives way must not lose it.
TEST(Stream, ANewerFrameHoldsWhatWasDueOfTheOneItReplaces) {
  Rig rig;
  RawClient slow(rig.tcp_port(), kSmallBuffer);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_major(1);
  hello.mutable_hello()->set_minor(1);
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

TEST(Stream, EncodesOnceForEachDistinctChoice) {
  Rig rig;
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 6; ++i) {
    clients.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    clients.back()->hello();
    auto message = subscribe();
    message.mutable_subscribe()->set_depth(v1::DEPTH_RVL);
    message.mutable_subscribe()->set_um_per_unit(i < 3 ? 1 : 5);
    message.mutable_subscribe()->set_contact_box(i == 5);
    ASSERT_TRUE(clients.back()->request(message).has_done());
  }
  rig.port.publish(make_frame(7));
  for (const auto& client : clients) ASSERT_EQ(client->frame().sequence(), 7U);
  EXPECT_EQ(clients[0]->request(get_status()).status().encoded(), 3U);
}

TEST(Stream, SendsTheCamerasOwnJpeg) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = subscribe();
  message.mutable_subscribe()->set_jpeg(true);
  ASSERT_TRUE(client.request(message).has_done());
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true, .jpeg = true}));
  auto published = make_frame(1);
  rig.port.publish(published);
  auto frame = client.frame();
  EXPECT_FALSE(frame.has_jpeg()) << "not this camera's pixel format";
  EXPECT_FALSE(frame.has_depth());
  EXPECT_TRUE(frame.has_contact());
  published = make_frame(2);
  published.has_jpeg = true;
  published.jpeg = {1, 2, 3};
  rig.port.publish(published);
  frame = client.frame();
  EXPECT_EQ(frame.jpeg().data(), "\1\2\3");
}

TEST(Stream, SendsNoEventsToWhoWantsNone) {
  Rig rig;
  RawClient quiet(rig.tcp_port());
  RawClient other(rig.tcp_port());
  quiet.hello();
  other.hello();
  auto message = subscribe();
  message.mutable_subscribe()->set_events(false);
  ASSERT_TRUE(quiet.request(message).has_done());
  rig.port.emit(pipeline::ReferenceTaken{true, {}});
  ASSERT_TRUE(other.event().has_reference());
  auto status = get_status();
  status.set_id(9);
  quiet.send(status);
  EXPECT_TRUE(quiet.receive().value_or(v1::ServerMessage{}).has_reply());
  message.mutable_subscribe()->set_events(true);
  ASSERT_TRUE(quiet.request(message).has_done());
  rig.port.emit(pipeline::ReferenceTaken{true, {}});
  EXPECT_TRUE(quiet.event().has_reference());
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

TEST(Stream, AFrameCarriesTheCalibrationThatItWasMeasuredBy) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  v1::ClientMessage activate;
  activate.mutable_activate_calibration()->set_number(0);
  activate.set_id(50);
  client.send(activate);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  const std::uint64_t key = std::get<pipeline::UseCalibration>(command->what).key;
  EXPECT_GT(key, 0U);
  auto frame = make_frame(1);
  frame.calibration = 0;  // the pipeline's key of the one at start
  rig.port.publish(frame);
  auto got = client.frame();
  EXPECT_EQ(got.calibration(), 1U) << "current in the store at start";
  pipeline::CommandDone done{command->ticket, pipeline::Outcome::done, ""};
  done.at = {1, 2, 3};
  rig.port.emit(done);
  const auto event = client.event();
  EXPECT_EQ(event.calibration().name(), "factory");
  EXPECT_TRUE(event.calibration().has_number());
  EXPECT_EQ(event.calibration().number(), 0U);
  EXPECT_EQ(event.sequence(), 1U);
  EXPECT_EQ(event.monotonic_ns(), 2);
  EXPECT_EQ(event.wall_ns(), 3);
  frame.camera.sequence = 2;  // captured before, sent after
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().calibration(), 1U);
  frame.calibration = key;
  rig.port.publish(frame);
  got = client.frame();
  EXPECT_TRUE(got.has_calibration());
  EXPECT_EQ(got.calibration(), 0U);
  frame.calibration.reset();
  rig.port.publish(frame);
  EXPECT_FALSE(client.frame().has_calibration());
}

TEST(Stream, AnUploadHasItsNumberOnceItIsStored) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  client.subscribe(v1::DEPTH_INT16);
  v1::ClientMessage upload;
  upload.mutable_upload_calibration()->set_name("ball");
  upload.mutable_upload_calibration()->set_calibration_toml("good");
  upload.mutable_upload_calibration()->set_reference_png("png");
  upload.set_id(50);
  client.send(upload);
  EXPECT_EQ(client.event().calibration().number(), 4U);
  auto frame = make_frame(1);
  frame.calibration = std::get<pipeline::UseCalibration>(rig.port.wait_command(0).value().what).key;
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().calibration(), 4U);
  upload.mutable_upload_calibration()->set_calibration_toml("unwritable");
  client.send(upload);
  const auto event = client.event();
  EXPECT_EQ(event.calibration().name(), "ball");
  EXPECT_FALSE(event.calibration().has_number());
  frame.calibration = std::get<pipeline::UseCalibration>(rig.port.wait_command(1).value().what).key;
  rig.port.publish(frame);
  EXPECT_FALSE(client.frame().has_calibration());
}

}  // namespace
}  // namespace dtact::net::test
