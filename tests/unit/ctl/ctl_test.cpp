// The program against the server with a pipeline that the tests play.
#include "clients/ctl/ctl.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "tests/unit/client/played_daemon.hpp"
#include "tests/unit/ctl/run_ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

using net::test::answer_done;
using net::test::FakePort;
using net::test::Rig;
using test::ctl;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

TEST(Ctl, ExplainsItself) {
  const auto help = ctl({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out,
              AllOf(HasSubstr("status"), HasSubstr("watch"), HasSubstr("led"), HasSubstr("rezero"),
                    HasSubstr("calibration"), HasSubstr("3 no connection")));
  const auto version = ctl({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_THAT(version.out, StartsWith("dtactctl "));
}

TEST(Ctl, ReturnsTwoForWrongUsage) {
  EXPECT_EQ(ctl({}).code, 2);
  EXPECT_EQ(ctl({"dance"}).code, 2);
  EXPECT_EQ(ctl({"status", "--frobnicate"}).code, 2);
  EXPECT_EQ(ctl({"--port", "0", "status"}).code, 2);
  EXPECT_EQ(ctl({"led", "--brightness", "256"}).code, 2);
  EXPECT_EQ(ctl({"led", "--led", "9:ffffff"}).code, 2);
  EXPECT_EQ(ctl({"watch", "--seconds", "-1"}).code, 2);
  EXPECT_EQ(ctl({"calibration"}).code, 2);
  EXPECT_EQ(ctl({"calibration", "upload", "/no/such/folder"}).code, 2);
}

TEST(Ctl, ReturnsThreeWithoutADaemon) {
  std::uint16_t port = 0;
  {
    const Rig rig;
    port = rig.tcp_port();
  }
  const auto result = ctl({"--port", std::to_string(port), "status"});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.error, AllOf(StartsWith("dtactctl: nothing listens on 127.0.0.1"),
                                  HasSubstr("systemctl status dtactd")));
}

TEST(Status, ReportsWhereTheDaemonListens) {
  net::NetConfig config;
  config.address = "0.0.0.0";
  config.insecure = true;
  const Rig rig(config);
  const auto result = ctl(rig, {"status"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out, HasSubstr("listens      0.0.0.0:" + std::to_string(rig.tcp_port()) +
                                    ", INSECURE: every host that reaches it"));
}

TEST(Status, IsPrinted) {
  Rig rig;
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.health.set(pipeline::Health::not_realtime);
  status.realtime = {"capture: no real-time priority"};
  status.camera.backend = "sim";
  status.stages = {{"activity", 3, 9, 20}};
  status.light_followed = -0.0042;
  status.capture_thread = {5, 6, 7, 8};
  status.cpu = 3;
  rig.port.set_status(status);
  const auto result = ctl(rig, {"status"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("activity   p50 3 us, p99 9 us, max 20 us"), HasSubstr("0 encoded"),
                    HasSubstr("capture      on CPU 3; page faults 5 minor, 6 major; context "
                              "switches 7 waiting, 8 pre")));
  EXPECT_THAT(result.out, AllOf(StartsWith("state        serving\nhealth       not_realtime\n"),
                                HasSubstr("LimitRTPRIO"), HasSubstr("camera       sim"),
                                HasSubstr(" (simulated), "), HasSubstr("calibration  none"),
                                HasSubstr("brightness 255"),
                                HasSubstr("reference    follows the light by -0.42 %")));
}

TEST(Status, SaysOfEachControlWhatIsKnown) {
  Rig rig;
  pipeline::Status status;
  status.camera.backend = "v4l2";
  status.camera.controls = {
      {"gain", 5, hal::ControlVerdict::confirmed},
      {"gamma", 120, hal::ControlVerdict::accepted},
      {"sharpness", 3, hal::ControlVerdict::refused, "the camera refuses sharpness = 2"}};
  rig.port.set_status(status);
  EXPECT_THAT(ctl(rig, {"status"}).out,
              HasSubstr("             gain 5, confirmed by the camera\n"
                        "             gamma 120, accepted, cannot be confirmed\n"
                        "             sharpness 3, refused: the camera refuses sharpness = 2\n"));
}

TEST(Status, IsOneLineOfJson) {
  Rig rig;
  const auto result = ctl(rig, {"status", "--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              StartsWith(R"({"state":"STATE_SETTLING","health":[],"advice":"","camera":{)"));
  EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 1);
  EXPECT_THAT(result.out, Not(HasSubstr("\"calibration\":")));
  EXPECT_THAT(result.out, HasSubstr(R"("encoded":0,"capture_thread":{"minor_faults":0,)"));
}

TEST(Led, ShowsAndChanges) {
  Rig rig({}, answer_done);
  EXPECT_EQ(ctl(rig, {"led"}).out,
            "brightness 255, LEDs ffffff ffffff ffffff ffffff ffffff ffffff ffffff ffffff\n");
  EXPECT_THAT(ctl(rig, {"led", "--brightness", "128", "--json"}).out,
              AllOf(StartsWith(R"({"brightness":128,"leds":[{"r":255,"g":255,"b":255},)"),
                    EndsWith("],\"gamma\":1}\n")));
  EXPECT_EQ(ctl(rig, {"led", "--scheme", "scheme1"}).out,
            "brightness 128, LEDs ffffff ffffff 000000 000000 ffffff ffffff 000000 000000\n");
}

TEST(Led, SaysWhatTheRingDoesNotShow) {
  Rig rig;
  pipeline::Status status;
  status.ring_message = "/dev/spidev0.0: cannot be opened: turn it on";
  rig.port.set_status(status);
  const auto result = ctl(rig, {"led"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.out, AllOf(StartsWith("brightness 255, LEDs"),
                                EndsWith("\n/dev/spidev0.0: cannot be opened: turn it on\n")));
  EXPECT_THAT(ctl(rig, {"led", "--json"}).out, Not(HasSubstr("spidev")));
}

TEST(Led, ChangesSingleOnes) {
  Rig rig({}, answer_done);
  const auto result = ctl(rig, {"led", "--led", "0:ff0000", "--led", "7:0000ff"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out,
            "brightness 255, LEDs ff0000 ffffff ffffff ffffff ffffff ffffff ffffff 0000ff\n");
}

TEST(Led, PassesRefusalsOn) {
  Rig rig({}, answer_done);
  const auto result = ctl(rig, {"led", "--scheme", "disco"});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, HasSubstr("known are all, scheme1"));
}

TEST(Rezero, IsRefusedUnlessForced) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      const bool force = std::get<pipeline::Rezero>(command.what).force;
      return pipeline::CommandDone{
          command, force ? pipeline::Outcome::done : pipeline::Outcome::refused_contact,
          force ? "" : "there is contact"};
    });
  });
  const auto refused = ctl(rig, {"rezero"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_EQ(refused.error, "dtactctl: there is contact\n");
  EXPECT_EQ(ctl(rig, {"rezero", "--force"}).code, 0);
}

// A daemon may call itself, its camera and its clients anything, and answer anything.
TEST(Terminal, GetsNoCommandsOfADaemon) {
  v1::Reply status;
  status.mutable_status()->mutable_camera()->set_identity("Fin\x1b]0;ger");
  status.mutable_status()->add_realtime_refused("no\x1b[2Jne");
  status.mutable_status()->set_version("9\xc2\x9b\x38");
  client::test::PlayedDaemon daemon({[&](client::test::Peer& peer) {
                                       peer.greet();
                                       peer.answer(status);
                                     },
                                     [](client::test::Peer& peer) {
                                       peer.greet();
                                       peer.refuse(v1::ERROR_DENIED, "not\x1b[31m you");
                                     }});
  const std::string port = std::to_string(daemon.options.port);
  const auto shown = ctl({"--port", port, "status"});
  EXPECT_THAT(shown.out, AllOf(HasSubstr("Fin?]0;ger"), HasSubstr("no?[2Jne"), HasSubstr("9?8")));
  EXPECT_THAT(shown.out, Not(HasSubstr("\x1b")));
  EXPECT_EQ(ctl({"--port", port, "rezero"}).error, "dtactctl: not?[31m you\n");
}

}  // namespace
}  // namespace dtact::ctl
