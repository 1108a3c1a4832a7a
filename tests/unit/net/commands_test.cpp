#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "hal/base/clock.hpp"
#include "hal/image/png.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using pipeline::CommandDone;
using pipeline::Outcome;
using testing::HasSubstr;

v1::ClientMessage brightness(std::uint32_t value) {
  v1::ClientMessage message;
  message.mutable_set_light()->set_brightness(value);
  return message;
}

v1::ClientMessage scheme(const std::string& name) {
  v1::ClientMessage message;
  message.mutable_set_light()->set_scheme(name);
  return message;
}

v1::ClientMessage rezero(bool force) {
  v1::ClientMessage message;
  message.mutable_rezero()->set_force(force);
  return message;
}

/// Expects the request to be refused as invalid with a sentence that has `part` in it.
void expect_invalid(RawClient& client, const v1::ClientMessage& message, const std::string& part) {
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_INVALID);
  EXPECT_THAT(reply.error().message(), HasSubstr(part));
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

TEST(Ping, TellsTheTime) {
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
      CommandDone done{command.ticket, Outcome::done, ""};
      done.reference = std::move(copy);
      return done;
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
      return CommandDone{command.ticket, outcome, "ask again"};
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

TEST(SetLight, TellsSinceWhenFramesAreExposedUnderIt) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      CommandDone done{command.ticket, Outcome::done, ""};
      done.light_since_ns = 123;
      return done;
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(brightness(100)).light().since_ns(), 123);
  rig.port.emit(pipeline::LightChanged{{}, {4, 5, 6}, 7});
  const auto event = client.event();
  EXPECT_EQ(event.light().since_ns(), 7);
  EXPECT_EQ(event.sequence(), 4U);
  EXPECT_EQ(event.monotonic_ns(), 5);
  EXPECT_EQ(event.wall_ns(), 6);
}

TEST(Status, TellsNameSerialAndWhatEachClientTook) {
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
  EXPECT_EQ(hello.hello().rights(), v1::RIGHTS_CONTROL);
  EXPECT_THAT(hello.hello().features(),
              testing::ElementsAre("contact_absence", "decimation", "events", "jpeg", "ping",
                                   "predict_zstd", "rates", "reference", "region", "rvl", "stamps",
                                   "units"));
  v1::ClientMessage get;
  get.mutable_get_status();
  const auto told = client.request(get).status();
  EXPECT_EQ(told.name(), "gripper");
  EXPECT_EQ(told.serial(), "usb-1.2");
  EXPECT_EQ(told.light().since_ns(), 9);
  ASSERT_EQ(told.clients_size(), 1);
  EXPECT_EQ(told.clients(0).rights(), v1::RIGHTS_CONTROL);
  v1::ServerMessage answer;
  *answer.mutable_reply() = hello;
  EXPECT_EQ(told.clients(0).sent_bytes(), answer.ByteSizeLong() + 4) << "with its length";
  EXPECT_EQ(told.clients(0).waiting_bytes(), 0U);
}

TEST(SetLight, ChangesOnlyWhatIsSet) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  auto reply = client.request(brightness(100));
  EXPECT_EQ(reply.light().brightness(), 100U);
  EXPECT_EQ(reply.light().leds(3).g(), 255U);  // as the ring was
  reply = client.request(scheme("scheme4"));
  EXPECT_EQ(reply.light().brightness(), 100U);
  EXPECT_EQ(reply.light().leds(0).r(), 255U);
  EXPECT_EQ(reply.light().leds(2).r(), 0U);
  const auto command = rig.port.wait_command(1);
  ASSERT_TRUE(command.has_value());
  const auto& light = std::get<pipeline::SetLight>(command->what).light;
  EXPECT_EQ(light.brightness, 100);
  EXPECT_EQ(light.leds[2], (hal::Rgb{0, 0, 0}));
}

TEST(SetLight, TakesEightColours) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = scheme("all");
  for (std::uint32_t i = 0; i < 8; ++i) {
    auto& led = *message.mutable_set_light()->add_leds();
    led.set_r(i);
    led.set_b(255);
  }
  const auto reply = client.request(message);
  ASSERT_EQ(reply.light().leds_size(), 8);
  EXPECT_EQ(reply.light().leds(7).r(), 7U);
  EXPECT_EQ(reply.light().leds(7).g(), 0U);
  EXPECT_EQ(reply.light().leds(7).b(), 255U);
}

TEST(SetLight, NamesTheFieldThatIsWrong) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, brightness(256), "set_light.brightness: 256; allowed are 0 to 255");
  expect_invalid(client, scheme("disco"),
                 "\"disco\" is unknown; known are all, scheme1, scheme2, scheme3, scheme4");
  v1::ClientMessage message;
  message.mutable_set_light()->add_leds();
  expect_invalid(client, message, "1 colours, the ring has 8");
  for (int i = 0; i < 7; ++i) message.mutable_set_light()->add_leds();
  message.mutable_set_light()->mutable_leds(5)->set_g(1000);
  expect_invalid(client, message, "set_light.leds[5]: 0, 1000, 0");
  message.mutable_set_light()->mutable_leds(5)->set_g(255);
  message.mutable_set_light()->mutable_leds(7)->set_b(256);
  expect_invalid(client, message, "set_light.leds[7]: 0, 0, 256; allowed are 0 to 255");
  message.mutable_set_light()->mutable_leds(7)->set_b(255);
  message.mutable_set_light()->mutable_leds(0)->set_r(256);
  expect_invalid(client, message, "set_light.leds[0]: 256, 0, 0");
}

TEST(SetLight, AnswersOnlyWhenTheRingHasBeenWritten) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = brightness(10);
  message.set_id(50);
  client.send(message);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  // Anything that is answered now comes before the light's answer.
  v1::ClientMessage status;
  status.mutable_get_status();
  EXPECT_TRUE(client.request(status).has_status());
  rig.port.emit(CommandDone{command->ticket, Outcome::done, ""});
  const auto reply = client.reply();
  EXPECT_EQ(reply.id(), 50U);
  EXPECT_EQ(reply.light().brightness(), 10U);
}

TEST(SetLight, TheLastWriterWinsAndEveryoneIsTold) {
  Rig rig({}, [](FakePort& port) {
    port.answer([&port](const pipeline::Command& command) {
      port.emit(pipeline::LightChanged{std::get<pipeline::SetLight>(command.what).light});
      return CommandDone{command.ticket, Outcome::done, ""};
    });
  });
  RawClient a(rig.tcp_port());
  RawClient b(rig.tcp_port());
  RawClient watcher(rig.tcp_port());
  a.hello();
  b.hello();
  watcher.hello();
  EXPECT_EQ(a.request(brightness(10)).light().brightness(), 10U);
  EXPECT_EQ(b.request(brightness(20)).light().brightness(), 20U);
  EXPECT_EQ(watcher.event().light().brightness(), 10U);
  EXPECT_EQ(watcher.event().light().brightness(), 20U);
  // The next partial change builds on the last writer's light.
  EXPECT_EQ(a.request(scheme("scheme1")).light().brightness(), 20U);
}

TEST(SetLight, AChangeBuildsOnTheOneThatIsStillUnderWay) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  auto message = brightness(10);
  message.set_id(50);
  client.send(message);
  message = scheme("scheme2");
  message.set_id(51);
  client.send(message);
  const auto second = rig.port.wait_command(1);
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(std::get<pipeline::SetLight>(second->what).light.brightness, 10);
}

// The light of the first is told while the second is still to be written.
TEST(SetLight, AChangeBuildsOnTheLastOneAskedFor) {
  Rig rig;
  RawClient client(rig.tcp_port());
  client.hello();
  std::uint64_t id = 50;
  const auto send = [&](v1::ClientMessage message) {
    message.set_id(id++);
    client.send(message);
  };
  send(brightness(10));
  send(scheme("scheme2"));
  const auto first = rig.port.wait_command(0);
  ASSERT_TRUE(first.has_value() && rig.port.wait_command(1).has_value());
  rig.port.emit(CommandDone{first->ticket, Outcome::done, ""});
  rig.port.emit(pipeline::LightChanged{std::get<pipeline::SetLight>(first->what).light});
  EXPECT_EQ(client.event().light().brightness(), 10U);
  send(brightness(30));
  const auto third = rig.port.wait_command(2);
  ASSERT_TRUE(third.has_value());
  const auto& light = std::get<pipeline::SetLight>(third->what).light;
  EXPECT_EQ(light.brightness, 30);
  EXPECT_EQ(light.leds[0], (hal::Rgb{0, 0, 0})) << "scheme2 lights 2, 3, 6 and 7";
  EXPECT_EQ(light.leds[2], (hal::Rgb{255, 255, 255}));
}

TEST(SetLight, AFailedWriteIsNotBuiltOn) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      return CommandDone{command.ticket, Outcome::device_error, "/dev/spidev0.0: check the wiring"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(brightness(10));
  EXPECT_EQ(reply.error().code(), v1::ERROR_DEVICE);
  EXPECT_EQ(reply.error().message(), "/dev/spidev0.0: check the wiring");
  (void)client.request(scheme("scheme2"));
  const auto second = rig.port.wait_command(1);
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(std::get<pipeline::SetLight>(second->what).light.brightness, 255);
}

TEST(SetLight, ALightKeptForTheRingIsBuiltOn) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      return CommandDone{command.ticket, Outcome::ring_away, "/dev/spidev0.0: not there"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  EXPECT_EQ(client.request(brightness(10)).error().code(), v1::ERROR_DEVICE);
  (void)client.request(scheme("scheme2"));
  const auto second = rig.port.wait_command(1);
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(std::get<pipeline::SetLight>(second->what).light.brightness, 10);
}

TEST(Rezero, IsRefusedUnderContactUnlessForced) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      if (std::get<pipeline::Rezero>(command.what).force) {
        return CommandDone{command.ticket, Outcome::done, ""};
      }
      return CommandDone{command.ticket, Outcome::refused_contact, "something touches: free it"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(rezero(false));
  EXPECT_EQ(reply.error().code(), v1::ERROR_CONTACT);
  EXPECT_EQ(reply.error().message(), "something touches: free it");
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
  rig.port.emit(CommandDone{command->ticket, Outcome::done, ""});
  rig.port.emit(CommandDone{999, Outcome::done, ""});  // a ticket nobody has
  RawClient other(rig.tcp_port());
  EXPECT_NO_THROW(other.hello());
}

TEST(GetStatus, TellsEverything) {
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
  model->list = {-64, {-10, 0, 20, 40}, -64, -62};
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
  EXPECT_EQ(reply.camera().backend(), "sim");
  EXPECT_EQ(reply.camera().width(), 800U);
  EXPECT_EQ(reply.camera().condition(), "stalled");
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
