// Changes of the light by clients, and the events that follow.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/requests.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using pipeline::CommandDone;
using pipeline::Outcome;

v1::ClientMessage scheme(const std::string& name) {
  v1::ClientMessage message;
  message.mutable_set_light()->set_scheme(name);
  return message;
}

TEST(SetLight, ReportsSinceWhenFramesAreExposedUnderIt) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      CommandDone done{command, Outcome::done, ""};
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

TEST(SetLight, ChangesOnlyWhatIsSet) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  auto reply = client.request(brightness(100));
  EXPECT_EQ(reply.light().brightness(), 100U);
  EXPECT_EQ(reply.light().leds(3).g(), 255U);  // unchanged
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

TEST(SetLight, TakesTheDarkestAndTheBrightest) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  for (const std::uint32_t value : {0U, 255U}) {
    EXPECT_EQ(client.request(brightness(value)).light().brightness(), value);
  }
  v1::ClientMessage message;
  for (std::uint32_t i = 0; i < 8; ++i) {
    auto& led = *message.mutable_set_light()->add_leds();
    led.set_r(i % 3 == 0 ? 255 : 0);
    led.set_g(i % 3 == 1 ? 255 : 0);
    led.set_b(i % 3 == 2 ? 255 : 0);
  }
  const auto light = client.request(message).light();
  ASSERT_EQ(light.leds_size(), 8);
  EXPECT_EQ(light.leds(6).r(), 255U);
  EXPECT_EQ(light.leds(7).g(), 255U);
  EXPECT_EQ(light.leds(5).b(), 255U);
  EXPECT_EQ(light.leds(5).r(), 0U);
}

TEST(SetLight, NamesTheFieldThatIsWrong) {
  Rig rig({}, answer_done);
  RawClient client(rig.tcp_port());
  client.hello();
  expect_invalid(client, brightness(256), "set_light.brightness: 256; allowed are 0 to 255");
  expect_invalid(client, scheme("disco"),
                 "\"disco\" is unknown; known are all, scheme1, scheme2, scheme3, scheme4");
  expect_invalid(client, scheme(std::string(60'000, 'x')), std::string(64, 'x') + "\" is unknown");
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
  // A reply that comes now was sent before the light's reply.
  v1::ClientMessage status;
  status.mutable_get_status();
  EXPECT_TRUE(client.request(status).has_status());
  rig.port.emit(CommandDone{*command, Outcome::done, ""});
  const auto reply = client.reply();
  EXPECT_EQ(reply.id(), 50U);
  EXPECT_EQ(reply.light().brightness(), 10U);
}

TEST(SetLight, TheLastWriterWinsAndEveryoneIsReported) {
  Rig rig({}, [](FakePort& port) {
    port.answer([&port](const pipeline::Command& command) {
      port.emit(pipeline::LightChanged{std::get<pipeline::SetLight>(command.what).light});
      return CommandDone{command, Outcome::done, ""};
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

// The first change is reported while the second is not yet written.
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
  rig.port.emit(CommandDone{*first, Outcome::done, ""});
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

TEST(SetLight, SaysWhatIsWrongWithTheRing) {
  Outcome outcome = Outcome::device_error;
  Rig rig({}, [&](FakePort& port) {
    port.answer([&](const pipeline::Command& command) {
      return CommandDone{command, outcome, "/dev/spidev0.0: check the wiring"};
    });
  });
  RawClient client(rig.tcp_port());
  client.hello();
  const auto reply = client.request(brightness(10));
  EXPECT_EQ(reply.error().code(), v1::ERROR_DEVICE);
  EXPECT_EQ(reply.error().message(), "/dev/spidev0.0: check the wiring");
  outcome = Outcome::ring_away;
  EXPECT_EQ(client.request(brightness(10)).error().code(), v1::ERROR_DEVICE);
}

TEST(SetCamera, PassesWhatIsInRangeAndAnswersWithWhatTheCameraHas) {
  Rig rig({}, [](FakePort& port) {
    pipeline::Status status;
    status.camera.settings.exposure_us = {.value = 8300, .minimum = 100, .maximum = 50000};
    port.set_status(status);
    answer_done(port);
  });
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_set_camera()->set_exposure_us(4170);
  const auto reply = client.request(message);
  EXPECT_EQ(reply.camera().exposure_us().value(), 8300);  // as the port says
  EXPECT_EQ(reply.camera().exposure_us().maximum(), 50000);
  EXPECT_FALSE(reply.camera().has_gain());
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  const auto& change = std::get<pipeline::SetCamera>(command->what).change;
  EXPECT_EQ(change.exposure_us, 4170);
  EXPECT_EQ(change.gain, std::nullopt);
  for (const double us : {99.0, 50001.0, std::nan("")}) {
    message.mutable_set_camera()->set_exposure_us(us);
    expect_invalid(client, message, "; this camera has 100 to 50000");
  }
  message.mutable_set_camera()->set_exposure_us(4170);
  message.mutable_set_camera()->set_gain(2);
  expect_invalid(client, message, "set_camera.gain: this camera has no such control");
}

TEST(SetCamera, TakesTheEndsOfBothRanges) {
  Rig rig({}, [](FakePort& port) {
    pipeline::Status status;
    status.camera.settings.exposure_us = {.value = 8300, .minimum = 100, .maximum = 50000};
    status.camera.settings.gain = {.value = 2, .minimum = 1.5, .maximum = 7.75};
    port.set_status(status);
    answer_done(port);
  });
  RawClient client(rig.tcp_port());
  client.hello();
  std::size_t sent = 0;
  for (const auto& [us, gain] : {std::pair{100.0, 7.75}, {50000.0, 1.5}}) {
    v1::ClientMessage message;
    message.mutable_set_camera()->set_exposure_us(us);
    message.mutable_set_camera()->set_gain(gain);
    const auto reply = client.request(message);
    EXPECT_EQ(reply.camera().exposure_us().minimum(), 100);
    EXPECT_EQ(reply.camera().gain().minimum(), 1.5);
    EXPECT_EQ(reply.camera().gain().maximum(), 7.75);
    const auto command = rig.port.wait_command(sent++);
    ASSERT_TRUE(command.has_value());
    const auto& change = std::get<pipeline::SetCamera>(command->what).change;
    EXPECT_EQ(change.exposure_us, us);
    EXPECT_EQ(change.gain, gain);
  }
  for (const double gain : {1.49, 7.76}) {
    v1::ClientMessage message;
    message.mutable_set_camera()->set_gain(gain);
    expect_invalid(client, message, "this camera has 1.5 to 7.75");
  }
  // The first of two wrong ones is named; the right one is not passed on alone.
  v1::ClientMessage both;
  both.mutable_set_camera()->set_exposure_us(99);
  both.mutable_set_camera()->set_gain(9);
  expect_invalid(client, both, "set_camera.exposure_us: 99; this camera has 100 to 50000");
  both.mutable_set_camera()->set_exposure_us(100);
  expect_invalid(client, both, "set_camera.gain: 9");
  // Without either it is a question.
  v1::ClientMessage question;
  question.mutable_set_camera();
  EXPECT_EQ(client.request(question).camera().exposure_us().value(), 8300);
}

// Which settings a camera has is known once it has been opened.
TEST(SetCamera, SaysWhereACameraThatWasNeverThereIs) {
  Rig rig({}, [](FakePort& port) {
    pipeline::Status status;
    status.state = pipeline::State::camera_lost;
    status.camera_report.fix = "/dev/video0 is not there: plug it in";
    port.set_status(status);
  });
  RawClient client(rig.tcp_port());
  client.hello();
  v1::ClientMessage message;
  message.mutable_set_camera()->set_gain(2);
  const auto reply = client.request(message);
  EXPECT_EQ(reply.error().code(), v1::ERROR_DEVICE);
  EXPECT_EQ(reply.error().message(), "/dev/video0 is not there: plug it in");
}

}  // namespace
}  // namespace dtact::net::test
