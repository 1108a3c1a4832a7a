// The client library against the server.
#include "clients/cpp/client.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <thread>

#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using client::Client;
using client::Options;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

Options options(const Rig& rig) {
  Options o;
  o.port = rig.tcp_port();
  o.timeout = kPatience;
  return o;
}

template <typename T>
T next(Client& client) {
  for (;;) {
    auto message = client.next(kPatience);
    if (!message.has_value()) throw std::runtime_error("silence");
    if (auto* wanted = std::get_if<T>(&*message)) return std::move(*wanted);
  }
}

TEST(ClientLibrary, ConnectsAndKnowsTheDaemon) {
  Rig rig;
  const Client client(options(rig));
  EXPECT_EQ(client.server().program, "dtactd 9.8.7");
  EXPECT_EQ(client.server().major, 1U);
  EXPECT_EQ(client.server().frame_id, "dtact_surface");
  EXPECT_TRUE(client.same_machine());
}

TEST(ClientLibrary, SaysWhatToDoWhenNobodyListens) {
  Options o;
  {
    const Rig rig;
    o.port = rig.tcp_port();
  }
  try {
    const Client client(o);
    FAIL() << "connected to nobody";
  } catch (const client::ConnectionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("nothing listens on 127.0.0.1 port " + std::to_string(o.port)));
    EXPECT_THAT(e.what(), HasSubstr("systemctl status dtactd"));
  }
}

TEST(ClientLibrary, SaysWhatToDoWhenTheHostIsUnknown) {
  Options o;
  o.host = "no.such.host.invalid";
  EXPECT_THROW((void)Client(o), client::ConnectionError);
}

TEST(ClientLibrary, StreamsBothEncodings) {
  Rig rig;
  Client client(options(rig));
  for (const auto encoding : {client::Depth::int16, client::Depth::delta_zstd}) {
    client.subscribe({encoding, client::Luma::grey8});
    auto published = make_frame(1500, 6, 2);
    published.depth_um[3] = INT16_MIN;
    published.light.brightness = 99;
    published.health.set(pipeline::Health::light_unsettled);
    rig.port.publish(published);
    const auto frame = next<client::Frame>(client);
    EXPECT_EQ(frame.sequence, 1500U);
    EXPECT_EQ(frame.meaning, "arrival");
    EXPECT_EQ(frame.light.brightness, 99);
    EXPECT_THAT(frame.health, ElementsAre("light_unsettled"));
    ASSERT_TRUE(frame.depth.has_value());
    EXPECT_EQ(frame.depth->width, 6);
    EXPECT_EQ(frame.depth->height, 2);
    EXPECT_EQ(frame.depth->values[0], 1500);
    const auto mm = frame.depth->millimetres();
    EXPECT_FLOAT_EQ(mm[0], 1.5F);
    EXPECT_TRUE(std::isnan(mm[3]));
    ASSERT_TRUE(frame.luma.has_value());
    EXPECT_THAT(frame.luma->values, Each(1500 % 256));
  }
}

TEST(ClientLibrary, WaitsForTheNextAndGivesUp) {
  Rig rig;
  Client client(options(rig));
  EXPECT_FALSE(client.next(std::chrono::milliseconds(1)).has_value());
  EXPECT_FALSE(client.next(std::chrono::milliseconds(0)).has_value());
}

TEST(ClientLibrary, KeepsEventsAndTheNewestFramesWhileItWaitsForAnAnswer) {
  Rig rig;
  Client client(options(rig));
  RawClient other(rig.tcp_port());
  client.subscribe({});
  other.hello();
  other.subscribe(v1::DEPTH_INT16);
  for (std::uint64_t sequence = 1; sequence <= 6; ++sequence) {
    rig.port.publish(make_frame(sequence));
    EXPECT_EQ(other.frame().sequence(), sequence);
  }
  rig.port.emit(pipeline::ReferenceTaken{42, false});
  (void)other.event();
  (void)client.status();
  for (std::uint64_t sequence = 3; sequence <= 6; ++sequence) {
    EXPECT_EQ(next<client::Frame>(client).sequence, sequence);
  }
  const auto event = next<client::Event>(client);
  EXPECT_EQ(std::get<client::ReferenceTaken>(event).sequence, 42U);
}

TEST(ClientLibrary, CommandsAndRefusals) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      if (std::holds_alternative<pipeline::Rezero>(command.what)) {
        return pipeline::CommandDone{command.ticket, pipeline::Outcome::refused_contact, "free it"};
      }
      return pipeline::CommandDone{command.ticket, pipeline::Outcome::done, ""};
    });
  });
  Client client(options(rig));
  const auto light = client.set_light({50, "scheme1", {}});
  EXPECT_EQ(light.brightness, 50);
  EXPECT_EQ(light.leds[1], (client::Rgb{255, 255, 255}));
  EXPECT_EQ(light.leds[2], client::Rgb{});
  try {
    client.rezero();
    FAIL() << "not refused";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), client::Code::contact);
    EXPECT_STREQ(e.what(), "free it");
  }
  EXPECT_THROW((void)client.set_light({-1, {}, {}}), client::Refused);
  EXPECT_EQ(client.upload_calibration({"ball", "good", "png"}), 4U);
  EXPECT_EQ(std::get<client::CalibrationChanged>(next<client::Event>(client)).name, "ball");
  EXPECT_THROW((void)client.calibration(), client::Refused);
  EXPECT_EQ(client.status().clients.size(), 1U);
}

TEST(ClientLibrary, ListsReadsAndActivatesCalibrations) {
  Rig rig({}, answer_done);
  Client client(options(rig));
  const auto all = client.calibrations();
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all[0].number, client::kConfiguredCalibration);
  EXPECT_EQ(all[1].name, "first");
  EXPECT_EQ(all[1].uploaded, "2026-01-31T12:00:00Z");
  EXPECT_TRUE(all[1].current);
  EXPECT_FALSE(all[1].in_use);  // the pipeline has none
  ASSERT_TRUE(all[1].summary.has_value());
  EXPECT_EQ(all[1].summary->mm_per_px, 0.0414);
  EXPECT_EQ(all[1].summary->frame_width, 800U);
  EXPECT_FALSE(all[2].summary.has_value());
  EXPECT_EQ(all[2].damage, "calibration.toml:3: scale missing");
  const auto files = client.calibration(0);
  EXPECT_EQ(files.name, "factory");
  EXPECT_EQ(files.number, client::kConfiguredCalibration);
  client.activate_calibration(0);
  EXPECT_EQ(std::get<client::CalibrationChanged>(next<client::Event>(client)).name, "factory");
  EXPECT_TRUE(client.calibrations()[0].current);
  try {
    client.activate_calibration(2);
    FAIL() << "not refused";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), client::Code::invalid);
  }
  EXPECT_THROW((void)client.calibration(9), client::Refused);
}

TEST(ClientLibrary, RefusesToSendWhatIsTooLarge) {
  Rig rig;
  Client client(options(rig));
  EXPECT_THROW(client.upload_calibration({"ball", "x", std::string(17U << 20U, 'x')}),
               client::Refused);
  EXPECT_EQ(client.status().version, "9.8.7");  // and the connection goes on
}

TEST(ClientLibrary, SaysWhenTheDaemonEnds) {
  Rig rig;
  Client client(options(rig));
  rig.stop();
  EXPECT_THROW((void)client.next(kPatience), client::ConnectionError);
  EXPECT_THROW((void)client.status(), client::ConnectionError);
}

TEST(ClientLibrary, SaysWhyItWasRefused) {
  NetConfig config;
  config.max_clients = 0;
  Rig rig(config);
  try {
    const Client client(options(rig));
    FAIL() << "not refused";
  } catch (const client::ConnectionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("max_clients"));
  }
}

/// A daemon that greets, says why it ends, and resets the connection.
std::thread greet_and_reset(int listening, const std::string& reason) {
  return std::thread([=] {
    const base::UniqueFd fd(::accept(listening, nullptr, nullptr));
    const auto send = [&fd](const v1::ServerMessage& message) {
      const auto length = wire::encode_length(message.ByteSizeLong());
      std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
      message.AppendToString(&bytes);
      (void)::send(fd.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    };
    std::array<char, 1024> hello{};
    (void)::recv(fd.get(), hello.data(), hello.size(), 0);
    v1::ServerMessage greeting;
    greeting.mutable_reply()->set_id(1);
    greeting.mutable_reply()->mutable_hello()->set_major(wire::kMajor);
    send(greeting);
    v1::ServerMessage end;
    end.mutable_reply()->mutable_error()->set_message(reason);
    send(end);
    const linger now{1, 0};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
  });
}

TEST(ClientLibrary, SaysTheReasonThatCameBeforeAReset) {
  const base::UniqueFd listening(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(listening.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(listening.get(), 1), 0);
  ASSERT_EQ(::getsockname(listening.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
  std::thread daemon = greet_and_reset(listening.get(), "too many answers lay unread");
  Options o;
  o.port = ntohs(address.sin_port);
  o.timeout = kPatience;
  Client client(o);
  daemon.join();
  try {
    (void)client.status();
    FAIL() << "an answer from nobody";
  } catch (const client::ConnectionError& e) {
    EXPECT_STREQ(e.what(), "too many answers lay unread");
  }
}

TEST(ClientLibrary, Moves) {
  Rig rig;
  Client first(options(rig));
  Client second(std::move(first));
  EXPECT_EQ(second.status().version, "9.8.7");
}

}  // namespace
}  // namespace dtact::net::test
