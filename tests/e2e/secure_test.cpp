// TLS, tokens and the socket file, from the certificate that dtactctl makes to depth at the
// library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "clients/cpp/maps.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// Output of `dtactctl`.
std::string ctl(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), DTACTCTL_PROGRAM);
  std::string output;
  EXPECT_EQ(run_program(arguments, &output), 0) << output;
  return output;
}

/// A daemon with a certificate, two tokens and a socket file.
class Secure : public testing::Test {
 protected:
  Secure() {
    ctl({"cert", "-o", folder_.path().string(), "--name", "127.0.0.1"});
    fingerprint_ = ctl({"cert", "--show", file("dtactd.crt")});
    fingerprint_.resize(64);
    std::ofstream tokens(file("tokens"));
    for (const char* rights : {"view", "control"}) {
      tokens << ctl({"token", "--new", rights, "-o", file(rights)});
      (rights == std::string("view") ? view_ : control_) = client::read_token(file(rights));
    }
    tokens.close();
    fs::permissions(file("tokens"), fs::perms::owner_read | fs::perms::owner_write);
    sensor_ = std::make_unique<Sensor>(
        fs::path(), true,
        std::vector<std::string>{
            "net.tls_certificate=" + file("dtactd.crt"), "net.tls_key=" + file("dtactd.key"),
            "net.tokens=" + file("tokens"), "net.unix_socket=" + file("sock")});
  }

  [[nodiscard]] std::string file(const char* name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] client::Options options(const std::string& token) const {
    client::Options o;
    o.port = sensor_->daemon->port();
    o.timeout = std::chrono::seconds(20);
    o.token = token;
    o.tls = client::Tls{fingerprint_, ""};
    return o;
  }
  static void expect_depth(client::Client& client) {
    client.subscribe();
    EXPECT_TRUE(read_until(client, [](const Item& item) {
      const auto* frame = std::get_if<v1::Frame>(&item);
      return frame != nullptr && frame->has_depth() &&
             !client::millimetres_of(frame->depth()).empty();
    }));
  }

  TempFolder folder_;
  std::string fingerprint_;
  std::string view_;
  std::string control_;
  std::unique_ptr<Sensor> sensor_;
};

TEST_F(Secure, ATokenGivesItsRights) {
  client::Client viewer(options(view_));
  EXPECT_EQ(viewer.server().rights(), v1::RIGHTS_VIEW);
  expect_depth(viewer);
  try {
    viewer.rezero();
    ADD_FAILURE();
  } catch (const client::Refused& e) {
    EXPECT_TRUE(e.denied()) << e.what();
  }
  client::Options by_ca = options(control_);
  by_ca.tls = client::Tls{"", file("dtactd.crt")};
  client::Client commander(by_ca);
  EXPECT_EQ(commander.server().rights(), v1::RIGHTS_CONTROL);
  v1::SetLight change;
  change.set_brightness(99);
  EXPECT_EQ(commander.set_light(change).brightness(), 99U);
}

TEST_F(Secure, WithoutThemNobodyGetsIn) {
  for (const std::string& token : {std::string(), std::string("wrong")}) {
    try {
      const client::Client client(options(token));
      ADD_FAILURE() << token;
    } catch (const client::Refused& e) {
      EXPECT_TRUE(e.denied()) << e.what();
    }
  }
  client::Options plain = options(control_);
  plain.tls.reset();
  try {
    const client::Client client(plain);
    ADD_FAILURE();
  } catch (const client::ConnectionError& e) {
    EXPECT_THAT(e.what(), HasSubstr("TLS"));
  }
}

TEST_F(Secure, TheSocketFileNeedsNeither) {
  client::Options local;
  local.host = "unix:" + file("sock");
  client::Client client(local);
  EXPECT_EQ(client.server().rights(), v1::RIGHTS_CALIBRATE);
  expect_depth(client);
  EXPECT_THAT(ctl({"--host", local.host, "status"}), HasSubstr("serving"));
}

TEST_F(Secure, ASubscriptionSurvivesTheDaemonsRestart) {
  client::Options lasting = options(control_);
  lasting.host = "unix:" + file("sock");
  lasting.reconnect.emplace();
  client::Client client(lasting);
  expect_depth(client);
  sensor_->restart();
  bool again = false;
  EXPECT_TRUE(read_until(client, [&again](const Item& item) {
    again = again || std::holds_alternative<client::Reconnected>(item);
    const auto* frame = std::get_if<v1::Frame>(&item);
    return again && frame != nullptr && frame->has_depth();
  }));
}

}  // namespace
}  // namespace dtact::e2e
