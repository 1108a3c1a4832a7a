// Requests of clients and their answers; SetLight has a file of its own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "hal/base/clock.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using pipeline::CommandDone;
using pipeline::Outcome;
using testing::HasSubstr;

v1::ClientMessage rezero(bool force) {
  v1::ClientMessage message;
  message.mutable_rezero()->set_force(force);
  return message;
}

TEST(Subscribe, RefusesUnknownEncodings) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_subscribe()->set_depth(static_cast<v1::DepthEncoding>(9));
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_UNSUPPORTED);
  EXPECT_THAT(reply.error().message(), HasSubstr("encoding 9"));
  message.mutable_subscribe()->set_depth(v1::DEPTH_NONE);
  message.mutable_subscribe()->set_luma_hz(2000);
  expect_invalid(client, message, "subscribe.luma_hz: 2000");
}

TEST(Ping, ReportsTheTime) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_ping();
  auto& clock = base::system_clock();
  const std::int64_t before = clock.monotonic_ns();
  const std::int64_t wall_before = clock.wall_ns();
  const auto pong = client.request(message).pong();
  EXPECT_GE(pong.monotonic_ns(), before);
  EXPECT_LE(pong.monotonic_ns(), clock.monotonic_ns());
  EXPECT_GE(pong.wall_ns(), wall_before);
}

v1::ClientMessage get_reference() {
  v1::ClientMessage message;
  message.mutable_get_reference();
  return message;
}

TEST(GetReference, SendsTheImageAsPng) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      auto copy = std::make_shared<pipeline::ReferenceCopy>();
      copy->width = 3;
      copy->height = 2;
      copy->image_q8 = {0, 1, 256, 25600, 65280, 65535};
      copy->light.brightness = 128;
      copy->sequence = 41;
      return CommandDone{{pipeline::CopyReference{std::move(copy)}, command.then}};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reference = client.request(get_reference()).reference();
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  EXPECT_TRUE(std::holds_alternative<pipeline::CopyReference>(command->what));
  const auto image = image::decode_png_grey16(reference.png(), "reference");
  EXPECT_EQ(image.width, 3);
  EXPECT_EQ(image.height, 2);
  EXPECT_EQ(image.pixels, (std::vector<std::uint16_t>{0, 1, 256, 25600, 65280, 65535}));
  EXPECT_EQ(reference.light().brightness(), 128U);
  EXPECT_EQ(reference.sequence(), 41U);
  EXPECT_EQ(reference.calibration(), 1U) << "the store's current one";
}

TEST(GetReference, SaysWhyThereIsNone) {
  Outcome outcome = Outcome::uncalibrated;
  Rig rig({}, [&outcome](FakePort& port) {
    port.answer([&outcome](const pipeline::Command& command) {
      return CommandDone{command, outcome, "ask again"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(get_reference()).error().code(), v1::ERROR_UNCALIBRATED);
  outcome = Outcome::no_reference;
  EXPECT_EQ(client.request(get_reference()).error().code(), v1::ERROR_BUSY);
  rig.port.set_full(true);
  EXPECT_EQ(client.request(get_reference()).error().code(), v1::ERROR_BUSY);
}

TEST(Status, ReportsNameSerialAndWhatEachClientTook) {
  NetConfig config;
  config.name = "gripper";
  Rig rig(config);
  pipeline::Status status;
  status.camera.identity = "usb-1.2";
  status.light_since_ns = 9;
  rig.port.set_status(status);
  RawClient client(rig.tcp_port());
  v1::ClientMessage message;
  message.mutable_hello()->set_major(1);
  const auto hello = client.request(message);
  EXPECT_EQ(hello.hello().minor(), 1U);
  EXPECT_EQ(hello.hello().name(), "gripper");
  EXPECT_EQ(hello.hello().serial(), "usb-1.2");
  EXPECT_EQ(hello.hello().rights(), v1::RIGHTS_CALIBRATE);
  EXPECT_THAT(hello.hello().features(),
              testing::ElementsAre("jpeg", "reconstruction", "reference"));
  v1::ClientMessage get;
  get.mutable_get_status();
  const auto reported = client.request(get).status();
  EXPECT_EQ(reported.name(), "gripper");
  EXPECT_EQ(reported.serial(), "usb-1.2");
  EXPECT_EQ(reported.light().since_ns(), 9);
  ASSERT_EQ(reported.clients_size(), 1);
  EXPECT_EQ(reported.clients(0).rights(), v1::RIGHTS_CALIBRATE);
  v1::ServerMessage answer;
  *answer.mutable_reply() = hello;
  EXPECT_EQ(reported.clients(0).sent_bytes(), answer.ByteSizeLong() + 4) << "with its length";
  EXPECT_EQ(reported.clients(0).waiting_bytes(), 0U);
}

TEST(Rezero, IsRefusedUnderContactUnlessForced) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      if (std::get<pipeline::Rezero>(command.what).force) {
        return CommandDone{command, Outcome::done, ""};
      }
      return CommandDone{command, Outcome::refused_contact, "there is contact: free it"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(rezero(false));
  EXPECT_EQ(reply.error().code(), v1::ERROR_CONTACT);
  EXPECT_EQ(reply.error().message(), "there is contact: free it");
  EXPECT_TRUE(client.request(rezero(true)).has_done());
}

TEST(Commands, AreRefusedAsBusyWhenThePipelineIsFull) {
  Rig rig;
  rig.port.set_full(true);
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(rezero(false)).error().code(), v1::ERROR_BUSY);
  EXPECT_EQ(client.request(brightness(1)).error().code(), v1::ERROR_BUSY);
}

TEST(Commands, OutliveTheClientThatSentThem) {
  Rig rig;
  auto client = std::make_unique<RawClient>(rig.tcp_port());
  client->hello();
  auto message = brightness(10);
  message.set_id(9);
  client->send(message);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  client.reset();
  ASSERT_TRUE(rig.wait_log("the client left"));
  rig.port.emit(CommandDone{*command, Outcome::done, ""});
  RawClient other(rig.tcp_port());
  EXPECT_NO_THROW(other.hello());
}

TEST(GetStatus, ReportsEverything) {
  Rig rig;
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.health.set(pipeline::Health::light_mismatch);
  status.camera.backend = "sim";
  status.camera.width = 800;
  status.camera.controls = {{"exposure", 157, hal::ControlVerdict::confirmed},
                            {"gamma", 100, hal::ControlVerdict::accepted},
                            {"gain", 5, hal::ControlVerdict::refused, "no"}};
  status.camera_report.state = hal::CameraState::stalled;
  status.camera_report.lost = 3;
  status.ring.backend = "null";
  status.frames = 600;
  status.fps = 59.9;
  status.realtime = {"no SCHED_FIFO"};
  status.stages = {{"smooth", 400, 900, 1200}};
  status.light_followed = -0.004;
  status.capture_thread = {5, 6, 7, 8};
  auto calibration = std::make_shared<calibration::Calibration>();
  calibration->name = "ball";
  auto model = std::make_shared<recon::Model>();
  model->mm_per_px = 0.051;
  model->lut = {-64, {-10, 0, 20, 40}, -64, -62};
  model->rectify.width = 580;
  model->rectify.height = 570;
  model->rectify.frame_width = 800;
  model->rectify.frame_height = 600;
  calibration->model = model;
  status.calibration = calibration;
  rig.port.set_status(status);
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_get_status();
  const auto reply = client.request(message).status();
  EXPECT_EQ(reply.state(), v1::STATE_SERVING);
  EXPECT_EQ(reply.health(0), v1::HEALTH_LIGHT_MISMATCH);
  EXPECT_THAT(reply.advice(), HasSubstr("dtactctl led"));
  ASSERT_EQ(reply.fixes_size(), reply.health_size());
  EXPECT_THAT(reply.fixes(0), HasSubstr("dtactctl led"));
  EXPECT_EQ(reply.camera().backend(), "sim");
  EXPECT_EQ(reply.camera().width(), 800U);
  EXPECT_EQ(reply.camera().state(), "stalled");
  EXPECT_EQ(reply.camera().lost(), 3U);
  EXPECT_EQ(reply.camera().controls(0).value(), 157);
  EXPECT_EQ(reply.camera().controls(0).verdict(), v1::CONTROL_VERDICT_CONFIRMED);
  EXPECT_TRUE(reply.camera().controls(0).locked());
  EXPECT_EQ(reply.camera().controls(1).verdict(), v1::CONTROL_VERDICT_ACCEPTED);
  EXPECT_TRUE(reply.camera().controls(1).locked());
  EXPECT_EQ(reply.camera().controls(2).verdict(), v1::CONTROL_VERDICT_REFUSED);
  EXPECT_FALSE(reply.camera().controls(2).locked());
  EXPECT_EQ(reply.ring().backend(), "null");
  EXPECT_EQ(reply.light().brightness(), 255U);
  EXPECT_EQ(reply.frames(), 600U);
  EXPECT_EQ(reply.fps(), 59.9);
  EXPECT_EQ(reply.realtime_refused(0), "no SCHED_FIFO");
  EXPECT_EQ(reply.stages(0).p99_us(), 900.0);
  EXPECT_EQ(reply.stages_size(), 1);  // nothing was sent
  EXPECT_EQ(reply.encoded(), 0U);
  EXPECT_EQ(reply.light_followed(), -0.004);
  EXPECT_EQ(reply.capture_thread().minor_faults(), 5U);
  EXPECT_EQ(reply.capture_thread().major_faults(), 6U);
  EXPECT_EQ(reply.capture_thread().waits(), 7U);
  EXPECT_EQ(reply.capture_thread().preemptions(), 8U);
  EXPECT_EQ(reply.calibration().name(), "ball");
  EXPECT_EQ(reply.calibration().covered_from_mm(), -0.01);
  EXPECT_EQ(reply.calibration().covered_to_mm(), 0.02);
  EXPECT_EQ(reply.calibration().width(), 580U);
  EXPECT_EQ(reply.calibration().height(), 570U);
  EXPECT_EQ(reply.calibration().frame_width(), 800U);
  EXPECT_EQ(reply.calibration().frame_height(), 600U);
  EXPECT_EQ(reply.clients_size(), 1);
  EXPECT_EQ(reply.clients(0).program(), "raw");
  EXPECT_EQ(reply.version(), "9.8.7");
}

}  // namespace
}  // namespace dtact::net::test
