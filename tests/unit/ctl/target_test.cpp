// Which daemon the programs connect to, and with which credentials.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "clients/ctl/ctl.hpp"
#include "tests/unit/client/certificate.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using client::test::Certificate;
using client::test::listen_on;
using client::test::Peer;
using client::test::PlayedDaemon;
using testing::AllOf;
using testing::HasSubstr;

class Target : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "dtact_target_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    write_token(fs::perms::owner_read | fs::perms::owner_write);
  }
  void TearDown() override { fs::remove_all(folder_); }

  void write_token(fs::perms permissions) const {
    std::ofstream(token_file()) << "s3cret\n";
    fs::permissions(token_file(), permissions);
  }
  [[nodiscard]] fs::path token_file() const { return folder_ / "token"; }
  [[nodiscard]] fs::path folder() const { return folder_; }

  /// `dtactctl led` with these options.
  int led(std::vector<std::string> options) {
    options.insert(options.begin(), "led");
    std::ostringstream out;
    std::ostringstream error;
    const int code = run(options, out, error);
    error_ = error.str();
    return code;
  }
  [[nodiscard]] const std::string& error() const { return error_; }

  PlayedDaemon::Play play() {
    return [this](Peer& peer) {
      token_ = peer.greet().token();
      v1::Reply status;
      status.mutable_status()->mutable_light()->set_brightness(7);
      peer.answer(status);
    };
  }
  std::string token_;

 private:
  fs::path folder_;
  std::string error_;
};

TEST_F(Target, IsNamedByHostAndPortInOne) {
  PlayedDaemon daemon({play()});
  EXPECT_EQ(led({"--host", "127.0.0.1:" + std::to_string(daemon.options.port), "--token-file",
                 token_file().string()}),
            0)
      << error();
  daemon.finish();
  EXPECT_EQ(token_, "s3cret");
}

TEST_F(Target, IsASocketFile) {
  const PlayedDaemon daemon({play()}, listen_on(folder() / "sock"));
  EXPECT_EQ(led({"--host", "unix:" + (folder() / "sock").string()}), 0) << error();
}

TEST_F(Target, HasTheCertificateThatIsPinned) {
  const Certificate certificate("IP:127.0.0.1");
  certificate.write_pem(folder() / "ca.pem");
  PlayedDaemon daemon({play(), play(), play()}, listen_on(), certificate.server());
  const std::string port = std::to_string(daemon.options.port);
  EXPECT_EQ(led({"--port", port, "--fingerprint", certificate.fingerprint()}), 0) << error();
  EXPECT_EQ(led({"--port", port, "--ca-file", (folder() / "ca.pem").string()}), 0) << error();
  EXPECT_EQ(led({"--port", port, "--fingerprint", std::string(64, '0')}), 3);
  EXPECT_THAT(error(), AllOf(HasSubstr(certificate.fingerprint()), HasSubstr("dtactctl cert")));
}

TEST_F(Target, GetsNoTokenThatOthersCanRead) {
  write_token(fs::perms::owner_read | fs::perms::others_read);
  EXPECT_EQ(led({"--token-file", token_file().string()}), 1);
  EXPECT_THAT(error(), HasSubstr("chmod 600"));
}

}  // namespace
}  // namespace dtact::ctl
