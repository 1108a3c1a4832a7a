// Rights of clients: tokens, addresses beyond this machine, and what status reports of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "daemon/serve/security.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

using calibration::TempFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kView = "0123456789abcdef";
constexpr const char* kControl = "fedcba9876543210";
constexpr const char* kCalibrate = "89abcdef01234567";

/// A server that asks for tokens.
class Guarded : public ::testing::Test {
 protected:
  Guarded() {
    config_.token_file = folder_.path() / "tokens";
    base::write_file_atomically(config_.token_file,
                                "view " + wire::token_hash(kView) + " eye\ncontrol " +
                                    wire::token_hash(kControl) + " hand\ncalibrate " +
                                    wire::token_hash(kCalibrate) + " bench\n",
                                0600);
  }

  TempFolder folder_;
  NetConfig config_;
};

v1::ClientMessage message_of(void (*fill)(v1::ClientMessage&)) {
  v1::ClientMessage message;
  fill(message);
  return message;
}

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
TEST(Rights, AreEverythingWhereNoTokensAre) {
  const Rig rig;
  RawClient client(rig.tcp_port());
  EXPECT_EQ(client.say_hello().hello().rights(), v1::RIGHTS_CALIBRATE);
}

TEST(Rights, AreThoseOfTheSettingsWhereNoTokensAre) {
  NetConfig config;
  config.anonymous_rights = Rights::view;
  const Rig rig(config);
  RawClient client(rig.tcp_port());
  EXPECT_EQ(client.say_hello().hello().rights(), v1::RIGHTS_VIEW);
}

TEST_F(Guarded, ReportsWhatATokenAllows) {
  Rig rig(config_);
  RawClient viewer(rig.tcp_port());
  EXPECT_EQ(viewer.say_hello(kView).hello().rights(), v1::RIGHTS_VIEW);
  RawClient controller(rig.tcp_port());
  EXPECT_EQ(controller.say_hello(kControl).hello().rights(), v1::RIGHTS_CONTROL);
  RawClient calibrator(rig.tcp_port());
  EXPECT_EQ(calibrator.say_hello(kCalibrate).hello().rights(), v1::RIGHTS_CALIBRATE);
  EXPECT_TRUE(rig.wait_log("(raw) connected as eye"));
}

TEST_F(Guarded, RefusesAMissingAndAWrongToken) {
  Rig rig(config_);
  RawClient none(rig.tcp_port());
  const auto reply = none.say_hello();
  EXPECT_EQ(reply.id(), 1U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_DENIED);
  EXPECT_THAT(reply.error().message(), HasSubstr("asks for a token"));
  EXPECT_TRUE(none.ends());
  RawClient wrong(rig.tcp_port());
  const auto other = wrong.say_hello("0123456789abcdeX");
  EXPECT_EQ(other.error().code(), v1::ERROR_DENIED);
  EXPECT_THAT(other.error().message(), HasSubstr("does not know the token"));
  EXPECT_TRUE(wrong.ends());
  EXPECT_THAT(rig.log(), Not(HasSubstr("0123456789abcdeX")));
}

// Before: only clients that waited for the answer were logged, and one that guesses need not wait.
TEST_F(Guarded, LogsAWrongTokenOfAClientThatLeavesAtOnce) {
  Rig rig(config_);
  {
    RawClient hasty(rig.tcp_port());
    hasty.send(message_of([](v1::ClientMessage& m) {
      m.set_id(1);
      m.mutable_hello()->set_major(1);
      m.mutable_hello()->set_token("0123456789abcdeX");
    }));
    hasty.finish();
    EXPECT_TRUE(hasty.ends());
  }
  EXPECT_TRUE(rig.wait_log("does not know the token"));
}

TEST_F(Guarded, ServesOthersWhileOneWaitsForItsRefusal) {
  const Rig rig(config_);
  RawClient wrong(rig.tcp_port());
  auto hello = message_of([](v1::ClientMessage& m) {
    m.set_id(1);
    m.mutable_hello()->set_major(1);
  });
  wrong.send(hello);
  // The message behind it is not read, not even as a second attempt.
  hello.set_id(2);
  hello.mutable_hello()->set_token(kControl);
  wrong.send(hello);
  RawClient right(rig.tcp_port());
  EXPECT_TRUE(right.say_hello(kView).has_hello());
  const auto reply = wrong.reply();
  EXPECT_EQ(reply.id(), 1U);
  EXPECT_EQ(reply.error().code(), v1::ERROR_DENIED);
  EXPECT_TRUE(wrong.ends());
}

TEST_F(Guarded, LetsViewersViewAndNothingElse) {
  const Rig rig(config_, answer_done);
  RawClient viewer(rig.tcp_port());
  viewer.hello(kView);
  using M = v1::ClientMessage;
  for (const auto& request :
       {message_of([](M& m) { m.mutable_set_light()->set_brightness(3); }),
        message_of([](M& m) { m.mutable_set_camera()->set_gain(2); }),
        message_of([](M& m) { m.mutable_rezero(); }),
        message_of([](M& m) { m.mutable_upload_calibration()->set_name("x"); }),
        message_of([](M& m) { m.mutable_activate_calibration()->set_number(1); }),
        message_of([](M& m) { m.mutable_set_reconstruction()->set_resolution("half"); })}) {
    const auto reply = viewer.request(request);
    EXPECT_EQ(reply.error().code(), v1::ERROR_DENIED) << request.ShortDebugString();
    EXPECT_THAT(reply.error().message(), HasSubstr("connect with a token that allows"));
  }
  EXPECT_TRUE(viewer.request(message_of([](M& m) { m.mutable_get_status(); })).has_status());
  EXPECT_TRUE(viewer.request(message_of([](M& m) { m.mutable_get_calibration()->set_number(1); }))
                  .has_calibration());
  EXPECT_TRUE(
      viewer.request(message_of([](M& m) { m.mutable_list_calibrations(); })).has_calibrations());
  EXPECT_NO_THROW(viewer.subscribe(v1::DEPTH_INT16));
  RawClient controller(rig.tcp_port());
  controller.hello(kControl);
  EXPECT_TRUE(controller.request(message_of([](M& m) { m.mutable_rezero(); })).has_done());
}

TEST_F(Guarded, ControlChangesLightReferenceAndMapsButNoCalibration) {
  const Rig rig(config_, answer_done);
  RawClient controller(rig.tcp_port());
  controller.hello(kControl);
  using M = v1::ClientMessage;
  for (const auto& request : {message_of([](M& m) { m.mutable_set_light()->set_brightness(3); }),
                              message_of([](M& m) { m.mutable_rezero(); }), message_of([](M& m) {
                                m.mutable_set_reconstruction()->set_resolution("half");
                              })}) {
    EXPECT_FALSE(controller.request(request).has_error()) << request.ShortDebugString();
  }
  for (const auto& request :
       {message_of([](M& m) { m.mutable_upload_calibration()->set_name("x"); }),
        message_of([](M& m) { m.mutable_activate_calibration()->set_number(1); }),
        message_of([](M& m) { m.mutable_pin_calibration()->set_number(1); })}) {
    const auto reply = controller.request(request);
    EXPECT_EQ(reply.error().code(), v1::ERROR_DENIED) << request.ShortDebugString();
    EXPECT_THAT(reply.error().message(), HasSubstr("a token that allows calibrate"));
  }
  RawClient calibrator(rig.tcp_port());
  calibrator.hello(kCalibrate);
  EXPECT_TRUE(
      calibrator.request(message_of([](M& m) { m.mutable_activate_calibration()->set_number(0); }))
          .has_done());
}

// Each command that changes something has a line in the log.
TEST_F(Guarded, ALineNamesWhoChangedWhatAndTheResult) {
  Rig rig(config_, answer_done);
  RawClient controller(rig.tcp_port());
  controller.hello(kControl);
  using M = v1::ClientMessage;
  (void)controller.request(message_of([](M& m) {
    m.mutable_set_light()->set_brightness(37);
    m.mutable_set_light()->set_scheme("scheme2");
  }));
  (void)controller.request(message_of([](M& m) { m.mutable_set_light()->set_brightness(256); }));
  (void)controller.request(message_of([](M& m) {
    m.mutable_rezero()->set_force(true);
    m.set_on_behalf_of("192.0.2.9:50211 (page, token lab)\n" + std::string(300, 'x'));
  }));
  (void)controller.request(
      message_of([](M& m) { m.mutable_set_reconstruction()->set_sharpen("off"); }));
  (void)controller.request(message_of([](M& m) {
    m.mutable_set_camera()->set_exposure_us(4170);
    m.mutable_set_camera()->set_gain(1.5);
  }));
  (void)controller.request(
      message_of([](M& m) { m.mutable_activate_calibration()->set_number(7); }));
  (void)controller.request(message_of([](M& m) { m.mutable_get_status(); }));
  RawClient calibrator(rig.tcp_port());
  calibrator.hello(kCalibrate);
  (void)calibrator.request(message_of([](M& m) {
    m.mutable_upload_calibration()->set_name("ball");
    m.mutable_upload_calibration()->set_calibration_toml("toml");
    m.mutable_upload_calibration()->set_reference_png("image");
  }));
  const std::string log = rig.log();
  const std::string who = " (raw, token hand): ";
  EXPECT_THAT(log, HasSubstr(who + "set_light brightness 37, scheme \"scheme2\": done\n"));
  EXPECT_THAT(log, HasSubstr(who + "set_light brightness 256: set_light.brightness: 256; allowed"));
  EXPECT_THAT(log,
              HasSubstr(" (raw, token hand) on behalf of 192.0.2.9:50211 (page, token lab)?xx"));
  EXPECT_THAT(log, Not(HasSubstr(std::string(256, 'x'))));
  EXPECT_THAT(log, HasSubstr("xx: rezero force: done\n"));
  EXPECT_THAT(log, HasSubstr(who + "set_reconstruction sharpen \"off\": done\n"));
  EXPECT_THAT(log, HasSubstr(who + "set_camera exposure_us 4170, gain 1.5: set_camera.exposure_us: "
                                   "this camera has no such control\n"));
  EXPECT_THAT(log, HasSubstr(who + "activate_calibration 7: this client may not change calibr"));
  EXPECT_THAT(log,
              HasSubstr(" (raw, token bench): upload_calibration \"ball\", 4 and 5 bytes: done, "
                        "calibration 4\n"));
  EXPECT_THAT(log, Not(HasSubstr("get_status")));
}

TEST_F(Guarded, TheLineComesThoughTheClientHasLeft) {
  Rig rig(config_);
  {
    RawClient controller(rig.tcp_port());
    controller.hello(kControl);
    controller.send(message_of([](v1::ClientMessage& m) {
      m.set_id(2);
      m.mutable_set_light()->set_brightness(37);
    }));
    ASSERT_TRUE(rig.port.wait_command(0).has_value());
  }
  ASSERT_TRUE(rig.wait_log("disconnected"));
  rig.port.emit(pipeline::CommandDone{*rig.port.wait_command(0), pipeline::Outcome::done, ""});
  EXPECT_TRUE(rig.wait_log(" (raw, token hand): set_light brightness 37: done"));
}

TEST_F(Guarded, AReloadEndsWhoseTokenIsGoneOrHasOtherRights) {
  Rig rig(config_);
  RawClient viewer(rig.tcp_port());
  viewer.hello(kView);
  RawClient controller(rig.tcp_port());
  controller.hello(kControl);
  RawClient calibrator(rig.tcp_port());
  calibrator.hello(kCalibrate);
  // Another name changes nothing.
  base::write_file_atomically(
      config_.token_file,
      "view " + wire::token_hash(kView) + " ear\nview " + wire::token_hash(kCalibrate) + " bench\n",
      0600);
  rig.reload(config_);
  for (RawClient* ended : {&controller, &calibrator}) {
    const auto reply = ended->reply();
    EXPECT_EQ(reply.id(), 0U);
    EXPECT_EQ(reply.error().code(), v1::ERROR_DENIED);
    EXPECT_THAT(reply.error().message(), HasSubstr("token was revoked, or given other rights"));
    EXPECT_TRUE(ended->ends());
  }
  EXPECT_TRUE(viewer.request(message_of([](v1::ClientMessage& m) { m.mutable_get_status(); }))
                  .has_status());
}

TEST_F(Guarded, ReportsStatusOfItsEndpointsAndClients) {
  const Rig rig(config_);
  RawClient viewer(rig.tcp_port());
  viewer.hello(kView);
  const auto status =
      viewer.request(message_of([](v1::ClientMessage& m) { m.mutable_get_status(); })).status();
  const std::string address = "127.0.0.1:" + std::to_string(rig.tcp_port());
  ASSERT_EQ(status.endpoints_size(), 1);
  EXPECT_EQ(status.endpoints(0).address(), address);
  EXPECT_FALSE(status.endpoints(0).tls());
  EXPECT_TRUE(status.endpoints(0).token());
  EXPECT_FALSE(status.endpoints(0).insecure());
  ASSERT_EQ(status.clients_size(), 1);
  EXPECT_EQ(status.clients(0).rights(), v1::RIGHTS_VIEW);
  EXPECT_EQ(status.clients(0).endpoint(), address);
  EXPECT_GT(status.clients(0).sent_bytes(), 0U);
}

TEST(Security, ReportsWhereAnybodyMayCome) {
  NetConfig config;
  config.address = "0.0.0.0";
  config.insecure = true;
  Rig rig(config);
  EXPECT_THAT(
      rig.log(),
      HasSubstr(
          "net.listen_insecure = true: every host that reaches 0.0.0.0 may watch and command"));
  RawClient client(rig.tcp_port());
  client.hello();
  const auto status =
      client.request(message_of([](v1::ClientMessage& m) { m.mutable_get_status(); })).status();
  ASSERT_EQ(status.endpoints_size(), 1);
  EXPECT_TRUE(status.endpoints(0).insecure());
}
// NOLINTEND(misc-const-correctness)

/// The refusal of the settings; empty when they are accepted.
std::string refusal(const NetConfig& config) {
  try {
    check_security(config);
    return {};
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

TEST(Security, NeedsTlsAndATokenBeyondThisMachine) {
  NetConfig config;
  for (const char* here : {"127.0.0.1", "127.3.2.1", "::1", ""}) {
    config.address = here;
    EXPECT_EQ(refusal(config), "") << here;
  }
  for (const char* beyond : {"0.0.0.0", "::", "192.0.2.7", "2001:db8::7"}) {
    config.address = beyond;
    EXPECT_THAT(refusal(config),
                AllOf(HasSubstr("net.address = \"" + std::string(beyond) + "\""),
                      HasSubstr("dtactctl cert"), HasSubstr("dtactctl token --new control"),
                      HasSubstr("net.listen_insecure = true"), HasSubstr("\"127.0.0.1\"")));
  }
  config.token_file = "/etc/tokens";
  EXPECT_THAT(refusal(config),
              AllOf(HasSubstr("net.tls_certificate"), Not(HasSubstr("token_file"))));
  config.tls_certificate = "/etc/crt";
  EXPECT_THAT(refusal(config), HasSubstr("set both or none"));
  config.tls_key = "/etc/key";
  EXPECT_EQ(refusal(config), "");
  config.token_file.clear();
  EXPECT_THAT(refusal(config), AllOf(HasSubstr("net.tokens"), Not(HasSubstr("dtactctl cert"))));
  config.insecure = true;
  EXPECT_EQ(refusal(config), "");
}

}  // namespace
}  // namespace dtact::net::test
