// Which parts of which frames reach a client.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "proto/depth_encoding.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using testing::Each;

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
  small.subscribe(v1::DEPTH_PREDICT_ZSTD);
  luma.subscribe(v1::DEPTH_NONE, v1::LUMA_GREY8);
  summary.subscribe(v1::DEPTH_NONE, v1::LUMA_NONE, 1, true);
  auto published = make_frame(7);
  published.contact.in_contact = true;
  published.contact.area_mm2 = 12.5;
  rig.port.publish(published);

  auto frame = small.frame();
  std::vector<std::int16_t> depth;
  ASSERT_TRUE(wire::decode_predict_zstd(frame.depth().data(), 8, 4, depth));
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
    clients.back()->subscribe(v1::DEPTH_PREDICT_ZSTD);
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

TEST(Stream, ReportsThePipelineTheUnionOfWhatIsWanted) {
  Rig rig;
  ASSERT_TRUE(rig.port.wait_wanted({}));
  auto depth = std::make_unique<RawClient>(rig.tcp_port());
  RawClient luma(rig.tcp_port());
  depth->hello();
  EXPECT_TRUE(rig.port.wait_wanted({.contact = true}));
  luma.hello();
  depth->subscribe(v1::DEPTH_PREDICT_ZSTD);
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
    EXPECT_EQ(frame.dropped(), 0U);  // frames that were not requested are not counted
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
  frame.number = 41;  // the others before this client was there
  rig.port.publish(frame);
  EXPECT_EQ(client.frame().dropped(), 0U);
  frame = make_frame(5);
  frame.number = 45;
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
  std::uint64_t number = 0;
  const auto publish = [&](std::uint64_t sequence, std::uint64_t missed) {
    auto frame = make_frame(sequence);
    frame.number = number += missed + 1;
    rig.port.publish(frame);
    ASSERT_EQ(all.frame().sequence(), sequence);
  };
  // The client is to get the frames 0, 3, 6, 9 of 0, 1, 2, ...
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
  const std::size_t reported = log.find("above the wire's cap");
  ASSERT_NE(reported, std::string::npos);
  EXPECT_EQ(log.find("above the wire's cap", reported + 1), std::string::npos);
  v1::ClientMessage status;
  status.mutable_get_status();
  const v1::Status now = client.request(status).status();
  ASSERT_EQ(now.clients_size(), 2);
  EXPECT_EQ(now.clients(0).dropped(), 3U);
  EXPECT_EQ(now.clients(1).dropped(), 0U);
}

TEST(Stream, EncodesOnceForEachDistinctChoice) {
  Rig rig;
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 6; ++i) {
    clients.push_back(std::make_unique<RawClient>(rig.tcp_port()));
    clients.back()->hello();
    auto message = subscribe();
    message.mutable_subscribe()->set_depth(v1::DEPTH_PREDICT_ZSTD);
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

}  // namespace
}  // namespace dtact::net::test
