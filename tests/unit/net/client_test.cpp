// The client library against the server.
#include "clients/cpp/client.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"
#include "tests/unit/client/played_daemon.hpp"
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
  o.timeout = kTimeout;
  return o;
}

v1::UploadCalibration files_of(const std::string& name, const std::string& toml) {
  v1::UploadCalibration files;
  files.set_name(name);
  files.set_calibration_toml(toml);
  files.set_reference_png("png");
  return files;
}

template <typename T>
T next(Client& client) {
  for (;;) {
    auto message = client.next(kTimeout);
    if (!message.has_value()) throw std::runtime_error("silence");
    if (auto* wanted = std::get_if<T>(&*message)) return std::move(*wanted);
  }
}

TEST(ClientLibrary, ConnectsAndKnowsTheDaemon) {
  Rig rig;
  const Client client(options(rig));
  EXPECT_EQ(client.server().program(), "dtactd 9.8.7");
  EXPECT_EQ(client.server().major(), 1U);
  EXPECT_EQ(client.server().surface_frame().frame_id(), "dtact_surface");
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

TEST(ClientLibrary, StreamsEveryEncoding) {
  Rig rig;
  Client client(options(rig));
  for (const auto encoding : {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD}) {
    v1::Subscribe both;
    both.set_depth(encoding);
    both.set_luma(v1::LUMA_GREY8);
    client.subscribe(both);
    auto published = make_frame(1500, 6, 2);
    published.depth_um[3] = INT16_MIN;
    published.light.brightness = 99;
    published.health.set(pipeline::Health::light_unsettled);
    rig.port.publish(published);
    auto frame = next<v1::Frame>(client);
    EXPECT_EQ(frame.sequence(), 1500U);
    EXPECT_EQ(frame.meaning(), v1::TIMESTAMP_ARRIVAL);
    EXPECT_EQ(frame.light().brightness(), 99U);
    EXPECT_THAT(client::names_of(frame.health()), ElementsAre("light_unsettled"));
    ASSERT_TRUE(frame.has_depth());
    EXPECT_EQ(frame.depth().width(), 6U);
    EXPECT_EQ(frame.depth().height(), 2U);
    EXPECT_EQ(client::values_of(frame.depth())[0], 1500);
    const auto mm = client::millimetres_of(frame.depth());
    EXPECT_FLOAT_EQ(mm[0], 1.5F);
    EXPECT_TRUE(std::isnan(mm[3]));
    ASSERT_TRUE(frame.has_luma());
    EXPECT_THAT(client::pixels_of(frame.luma()), Each(1500 % 256));
    // Damaged maps, and encodings of a newer daemon.
    frame.mutable_luma()->mutable_data()->pop_back();
    EXPECT_THROW((void)client::pixels_of(frame.luma()), client::ProtocolError);
    frame.mutable_depth()->mutable_data()->pop_back();
    EXPECT_THROW((void)client::values_of(frame.depth()), client::ProtocolError);
    frame.mutable_depth()->set_encoding(static_cast<v1::DepthEncoding>(9));
    EXPECT_THROW((void)client::values_of(frame.depth()), client::ProtocolError);
  }
}

TEST(ClientLibrary, WaitsForTheNextAndGivesUp) {
  Rig rig;
  Client client(options(rig));
  EXPECT_FALSE(client.next(std::chrono::milliseconds(1)).has_value());
  EXPECT_FALSE(client.next(std::chrono::milliseconds(0)).has_value());
}

// A resized terminal sends a signal, for example.
TEST(ClientLibrary, ASignalDoesNotEndAWait) {
  Rig rig;
  Client client(options(rig));
  struct sigaction action{};
  action.sa_handler = [](int) {};
  struct sigaction before{};
  ASSERT_EQ(::sigaction(SIGUSR1, &action, &before), 0);
  std::atomic<bool> over{false};
  std::thread signals([&over, waiting = ::pthread_self()] {
    while (!over) {
      ::pthread_kill(waiting, SIGUSR1);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  EXPECT_NO_THROW(EXPECT_FALSE(client.next(std::chrono::milliseconds(200)).has_value()));
  over = true;
  signals.join();
  ::sigaction(SIGUSR1, &before, nullptr);
}

TEST(ClientLibrary, KeepsEventsAndTheNewestFramesWhileItWaitsForAnAnswer) {
  Rig rig;
  Client client(options(rig));
  RawClient other(rig.tcp_port());
  client.subscribe();
  other.hello();
  other.subscribe(v1::DEPTH_INT16);
  for (std::uint64_t sequence = 1; sequence <= 6; ++sequence) {
    rig.port.publish(make_frame(sequence));
    EXPECT_EQ(other.frame().sequence(), sequence);
  }
  rig.port.emit(pipeline::ReferenceTaken{false, {.sequence = 42}});
  (void)other.event();
  (void)client.status();
  for (std::uint64_t sequence = 3; sequence <= 6; ++sequence) {
    EXPECT_EQ(next<v1::Frame>(client).sequence(), sequence);
  }
  EXPECT_EQ(next<v1::Event>(client).reference().sequence(), 42U);
}

TEST(ClientLibrary, CommandsAndRefusals) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      if (std::holds_alternative<pipeline::Rezero>(command.what)) {
        return pipeline::CommandDone{command, pipeline::Outcome::refused_contact, "free it"};
      }
      return pipeline::CommandDone{command, pipeline::Outcome::done, ""};
    });
  });
  Client client(options(rig));
  v1::SetLight change;
  change.set_brightness(50);
  change.set_scheme("scheme1");
  const auto light = client.set_light(change);
  EXPECT_EQ(light.brightness(), 50U);
  EXPECT_EQ(light.leds(1).g(), 255U);
  EXPECT_EQ(light.leds(2).g(), 0U);
  try {
    client.rezero();
    FAIL() << "not refused";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), v1::ERROR_CONTACT);
    EXPECT_STREQ(e.what(), "free it");
  }
  change.set_brightness(256);
  EXPECT_THROW((void)client.set_light(change), client::Refused);
  EXPECT_EQ(client.upload_calibration(files_of("ball", "good")).calibration(), 4U);
  EXPECT_EQ(next<v1::Event>(client).calibration().name(), "ball");
  EXPECT_THROW((void)client.calibration(), client::Refused);
  EXPECT_EQ(client.status().clients_size(), 1);
}

TEST(ClientLibrary, ListsReadsAndActivatesCalibrations) {
  Rig rig({}, answer_done);
  Client client(options(rig));
  const auto all = client.calibrations();
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all[0].number(), client::kConfiguredCalibration);
  EXPECT_EQ(all[1].name(), "first");
  EXPECT_EQ(all[1].uploaded(), "2026-01-31T12:00:00Z");
  EXPECT_TRUE(all[1].current());
  EXPECT_FALSE(all[1].in_use());  // the pipeline uses none
  ASSERT_TRUE(all[1].has_summary());
  EXPECT_EQ(all[1].summary().mm_per_px(), 0.0414);
  EXPECT_EQ(all[1].summary().frame_width(), 800U);
  EXPECT_FALSE(all[2].has_summary());
  EXPECT_EQ(all[2].damage(), "calibration.toml:3: scale missing");
  const auto files = client.calibration(0);
  EXPECT_EQ(files.name(), "factory");
  EXPECT_EQ(files.number(), client::kConfiguredCalibration);
  client.activate_calibration(0);
  EXPECT_EQ(next<v1::Event>(client).calibration().name(), "factory");
  EXPECT_TRUE(client.calibrations()[0].current());
  try {
    client.activate_calibration(2);
    FAIL() << "not refused";
  } catch (const client::Refused& e) {
    EXPECT_EQ(e.code(), v1::ERROR_INVALID);
  }
  EXPECT_THROW((void)client.calibration(9), client::Refused);
}

TEST(ClientLibrary, RefusesToSendWhatIsTooLarge) {
  Rig rig;
  Client client(options(rig));
  EXPECT_THROW(client.upload_calibration(files_of("ball", std::string(17U << 20U, 'x'))),
               client::Refused);
  EXPECT_EQ(client.status().version(), "9.8.7");  // and the connection goes on
}

TEST(ClientLibrary, SaysWhenTheDaemonEnds) {
  Rig rig;
  Client client(options(rig));
  rig.stop();
  EXPECT_THROW((void)client.next(kTimeout), client::ConnectionError);
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

using client::test::Peer;
using client::test::PlayedDaemon;

TEST(ClientLibrary, SaysTheReasonThatCameBeforeAReset) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    v1::ServerMessage end;
    end.mutable_reply()->mutable_error()->set_message("too many answers lay unread");
    peer.send(end);
    const linger now{1, 0};
    ::setsockopt(peer.fd(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
  }});
  Client client(daemon.options);
  daemon.finish();
  try {
    (void)client.status();
    FAIL() << "no daemon could answer";
  } catch (const client::ConnectionError& e) {
    EXPECT_STREQ(e.what(), "too many answers lay unread");
  }
}

TEST(ClientLibrary, GivesUpOnAnAnswerThoughFramesCome) {
  // A large batch, so that the next frame is always there: sending is faster than reading.
  PlayedDaemon daemon({[](Peer& peer) {
    peer.greet();
    v1::ServerMessage frame;
    frame.mutable_frame()->set_sequence(1);
    std::string frames;
    for (int i = 0; i < 10'000; ++i) frames += client::test::framed(frame);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (std::chrono::steady_clock::now() < end) peer.send_bytes(frames);
  }});
  daemon.options.timeout = std::chrono::seconds(1);
  Client client(daemon.options);
  EXPECT_THROW(client.rezero(), client::TimeoutError);
}

TEST(ClientLibrary, ALateAnswerIsNoneToTheNextRequest) {
  Rig rig;
  Options o = options(rig);
  o.timeout = std::chrono::seconds(2);
  Client client(o);
  EXPECT_THROW(client.rezero(), client::TimeoutError);
  const auto command = rig.port.wait_command(0);
  ASSERT_TRUE(command.has_value());
  rig.port.emit(pipeline::CommandDone{*command, pipeline::Outcome::done, ""});
  EXPECT_EQ(client.status().version(), "9.8.7");
}

// Calibrations are parsed and written before the answer.
TEST(ClientLibrary, WaitsLongerForCalibrationsThanForTheRest) {
  Rig rig;
  Options o = options(rig);
  o.timeout = std::chrono::seconds(1);
  Client client(o);
  std::thread pipeline([&rig] {
    const auto command = rig.port.wait_command(0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    rig.port.emit(
        pipeline::CommandDone{command.value_or(pipeline::Command{}), pipeline::Outcome::done, ""});
  });
  EXPECT_NO_THROW(client.activate_calibration(1));
  pipeline.join();
}

TEST(ClientLibrary, Moves) {
  Rig rig;
  Client first(options(rig));
  Client second(std::move(first));
  EXPECT_EQ(second.status().version(), "9.8.7");
}

}  // namespace
}  // namespace dtact::net::test
