// Changes of the reconstruction by clients, and the events that follow.
#include <gtest/gtest.h>

#include <limits>
#include <variant>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using pipeline::CommandDone;
using pipeline::Outcome;
using pipeline::ReconstructionRules;

template <typename Change>
v1::ClientMessage asking(Change change) {
  v1::ClientMessage message;
  change(*message.mutable_set_reconstruction());
  return message;
}

TEST(SetReconstruction, ChangesOnlyWhatIsSetAndReportsEveryone) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      return CommandDone{command, Outcome::done, "", {4, 5, 6}};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  RawClient other(rig.tcp_port());
  other.hello();
  const auto reply = client.request(asking([](auto& change) { change.set_resolution("auto"); }));
  EXPECT_EQ(reply.reconstruction().resolution(), "auto");
  EXPECT_EQ(reply.reconstruction().sharpen(), "off");
  EXPECT_EQ(reply.reconstruction().max_error_um(), 50);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  EXPECT_EQ(std::get<pipeline::SetReconstruction>(command->what).rules,
            (ReconstructionRules{.decimation = 0}));
  const auto event = other.event();
  EXPECT_EQ(event.reconstruction().resolution(), "auto");
  EXPECT_EQ(event.sequence(), 4U);
  EXPECT_EQ(event.monotonic_ns(), 5);
  EXPECT_EQ(event.wall_ns(), 6);
}

TEST(SetReconstruction, TakesEveryWord) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  for (const char* resolution : {"full", "half", "quarter", "auto"}) {
    const auto reply =
        client.request(asking([&](auto& change) { change.set_resolution(resolution); }))
            .reconstruction();
    EXPECT_EQ(reply.resolution(), resolution);
  }
  for (const char* sharpen : {"off", "1", "2", "auto"}) {
    const auto reply =
        client.request(asking([&](auto& change) { change.set_sharpen(sharpen); })).reconstruction();
    EXPECT_EQ(reply.sharpen(), sharpen);
  }
}

TEST(SetReconstruction, NamesTheFieldThatIsWrong) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(
      client, asking([](auto& change) { change.set_resolution("best"); }),
      "set_reconstruction.resolution: \"best\" is unknown; known are full, half, quarter");
  expect_invalid(client, asking([](auto& change) { change.set_sharpen("3"); }),
                 "set_reconstruction.sharpen: \"3\" is unknown; known are off, auto, 1, 2");
  expect_invalid(client, asking([](auto& change) { change.set_sharpen(std::string(60'000, '1')); }),
                 "\"" + std::string(64, '1') + "\" is unknown");
  for (const double bound : {0.0, -5.0, 10001.0, std::numeric_limits<double>::quiet_NaN()}) {
    expect_invalid(client, asking([&](auto& change) { change.set_max_error_um(bound); }),
                   "allowed are 1 to 10000");
  }
}

TEST(SetReconstruction, TakesTheSmallestAndTheLargestError) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  for (const double bound : {1.0, 10000.0}) {
    const auto reply =
        client.request(asking([&](auto& change) { change.set_max_error_um(bound); }));
    EXPECT_EQ(reply.reconstruction().max_error_um(), bound);
    EXPECT_EQ(reply.reconstruction().resolution(), "full");
  }
  for (const double bound : {0.999, 10000.5}) {
    expect_invalid(client, asking([&](auto& change) { change.set_max_error_um(bound); }),
                   "allowed are 1 to 10000");
  }
}

TEST(SetReconstruction, IsDoneOneAtATime) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = asking([](auto& change) { change.set_resolution("half"); });
  message.set_id(77);
  client.send(message);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  RawClient other(rig.tcp_port());
  other.hello();
  const auto again = asking([](auto& change) { change.set_resolution("quarter"); });
  EXPECT_EQ(other.request(again).error().code(), v1::ERROR_BUSY);
  rig.port.emit(CommandDone{*command, Outcome::done, ""});
  EXPECT_EQ(other.event().reconstruction().resolution(), "half");
}

// A reconstruction that is prepared for one calibration must not be used with the next.
TEST(SetReconstruction, WaitsForAnotherCalibration) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(0);
  message.set_id(50);
  client.send(message);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  const auto half = asking([](auto& change) { change.set_resolution("half"); });
  EXPECT_EQ(client.request(half).error().code(), v1::ERROR_BUSY);
  rig.port.emit(CommandDone{*command, Outcome::done, ""});
  EXPECT_EQ(client.reply().id(), 50U);
  message = half;
  message.set_id(51);
  client.send(message);
  EXPECT_TRUE(rig.port.wait_command(1).has_value());
}

TEST(SetReconstruction, WhatThePipelineRefusesIsReportedToNobodyElse) {
  Rig rig({}, [](FakePort& port) { port.set_unfit("no list"); });
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, asking([](auto& change) { change.set_sharpen("2"); }), "no list");
  rig.port.emit(pipeline::LightChanged{{}, {4, 5, 6}, 7});
  EXPECT_TRUE(client.event().has_light());
}

}  // namespace
}  // namespace dtact::net::test
