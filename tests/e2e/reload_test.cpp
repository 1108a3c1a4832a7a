// SIGHUP: the settings that a running daemon applies when it reads its configuration again.
#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>

#include "clients/cpp/client.hpp"
#include "hal/base/unique_fd.hpp"
#include "proto/fingerprint.hpp"
#include "tests/e2e/daemon_process.hpp"
#include "tests/fakes/notify_socket.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* kOldToken = "0123456789abcdef-old";
constexpr const char* kNewToken = "0123456789abcdef-new";

/// A daemon with a certificate and tokens, whose configuration is a file.
class Reload : public testing::Test {
 protected:
  Reload() {
    old_ = make_pair_in("old");
    write("tokens", "control " + wire::token_hash(kOldToken) + "\n");
    write("dtactd.toml", configuration("old", ""));
    daemon_ = std::make_unique<DaemonProcess>(
        std::vector<std::string>{"--config", file("dtactd.toml")},
        Environment{{"CREDENTIALS_DIRECTORY", folder_.path().string()}});
  }

  [[nodiscard]] std::string file(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    fs::permissions(file(name), fs::perms::owner_read | fs::perms::owner_write);
  }
  /// Returns the certificate's fingerprint.
  [[nodiscard]] std::string make_pair_in(const std::string& name) const {
    std::string output;
    EXPECT_EQ(run_program({DTACTCTL_PROGRAM, "cert", "-o", file(name), "--name", "127.0.0.1"}), 0);
    EXPECT_EQ(
        run_program({DTACTCTL_PROGRAM, "cert", "--show", file(name + "/dtactd.crt")}, &output), 0);
    return output.substr(0, 64);
  }
  /// `more` begins at line 9 of the file, in [net].
  [[nodiscard]] static std::string configuration(const std::string& pair, const std::string& more) {
    return "state_dir = 'state'\ncamera.backend = 'null'\nring.backend = 'null'\n[net]\nport = 0\n"
           "tokens = 'tokens'\ntls_certificate = '" +
           pair + "/dtactd.crt'\ntls_key = '" + pair + "/dtactd.key'\n" + more;
  }
  /// Sends SIGHUP. Returns the status that the service manager receives when the reload is done.
  [[nodiscard]] std::string reload() const {
    EXPECT_EQ(::kill(daemon_->pid(), SIGHUP), 0);
    bool reloading = false;
    while (const auto message = daemon_->next_notification(std::chrono::seconds(60))) {
      reloading = reloading || message->starts_with("RELOADING=1\nMONOTONIC_USEC=");
      if (message->starts_with("READY=1\nSTATUS=")) {
        EXPECT_TRUE(reloading);
        return message->substr(15);
      }
    }
    ADD_FAILURE() << "no READY=1 after SIGHUP";
    return {};
  }
  [[nodiscard]] std::unique_ptr<client::Client> connect(const std::string& fingerprint,
                                                        const std::string& token) const {
    client::Options o;
    o.port = daemon_->port();
    o.timeout = std::chrono::seconds(20);
    o.token = token;
    o.tls = client::Tls{fingerprint, ""};
    return std::make_unique<client::Client>(o);
  }

  TempFolder folder_;
  std::string old_;
  std::unique_ptr<DaemonProcess> daemon_;
};

TEST_F(Reload, TakesCertificateTokensAndLimits) {
  auto before = connect(old_, kOldToken);
  const std::string renewed = make_pair_in("new");
  write("tokens", "view " + wire::token_hash(kNewToken) + "\n");
  write("dtactd.toml", configuration("new", "max_clients = 2\n"));
  EXPECT_THAT(reload(),
              AllOf(HasSubstr("fps"), Not(HasSubstr("restart")),
                    EndsWith("listening on 127.0.0.1:" + std::to_string(daemon_->port()))));
  EXPECT_THAT(daemon_->log(),
              HasSubstr("changed: net.tls_certificate, net.tls_key, net.max_clients"));
  EXPECT_THROW((void)connect(renewed, kOldToken), client::Refused);
  EXPECT_THROW((void)connect(old_, kNewToken), client::ConnectionError);
  const auto after = connect(renewed, kNewToken);
  EXPECT_EQ(after->server().rights(), v1::RIGHTS_VIEW);
  EXPECT_EQ(after->status().endpoints(0).fingerprint(), renewed);
  // A revoked token ends its open connections, too.
  EXPECT_THROW((void)before->status(), client::Error);
  EXPECT_THAT(daemon_->log(), HasSubstr("this client's token was revoked"));
  before.reset();  // its place is free once it has closed, too
  const auto second = connect(renewed, kNewToken);
  EXPECT_THROW((void)connect(renewed, kNewToken), client::EndedByDaemon);  // the third
}

TEST_F(Reload, AMistakeLeavesEverythingAsItWas) {
  write("dtactd.toml", configuration("old", "max_clients = 1\nmax_requests_per_s = 0\n"));
  const std::string mistake = "dtactd.toml:10: net.max_requests_per_s: must be a whole number";
  EXPECT_THAT(reload(),
              AllOf(HasSubstr("the configuration stays as it was: "), HasSubstr(mistake)));
  EXPECT_THAT(daemon_->log(), HasSubstr(mistake));
  // The same for a mistake that only the named files have.
  write("dtactd.toml", configuration("old", "max_clients = 1\n"));
  write("tokens", "control short\n");
  EXPECT_THAT(reload(), HasSubstr("tokens:1: a token itself must not be kept"));
  const auto one = connect(old_, kOldToken);
  const auto two = connect(old_, kOldToken);
  EXPECT_EQ(two->server().rights(), v1::RIGHTS_CONTROL);
  // Once fixed, the reload succeeds.
  write("tokens", "control " + wire::token_hash(kOldToken) + "\n");
  EXPECT_THAT(reload(), Not(HasSubstr("stays")));
  EXPECT_THROW((void)connect(old_, kOldToken), client::EndedByDaemon);  // max_clients = 1
}

// TLS ends with a restart only, so its files may be gone before.
TEST_F(Reload, TakesTheRestWhereTlsIsToBeSwitchedOff) {
  fs::remove_all(file("old"));
  write("tokens", "view " + wire::token_hash(kNewToken) + "\n");
  std::string plain = configuration("old", "");
  plain.erase(plain.find("tls_certificate"));
  write("dtactd.toml", plain);
  EXPECT_THAT(reload(),
              HasSubstr("; needs a restart: net.tls_certificate, net.tls_key; listening"));
  EXPECT_THROW((void)connect(old_, kOldToken), client::Refused);
  EXPECT_EQ(connect(old_, kNewToken)->server().rights(), v1::RIGHTS_VIEW);
}

TEST_F(Reload, NamesWhatNeedsARestart) {
  write("dtactd.toml", configuration("old", "name = 'left'\n[contact]\ndebounce_frames = 3\n"));
  EXPECT_THAT(reload(),
              HasSubstr("; needs a restart: contact.debounce_frames, net.name; listening on "));
  EXPECT_THAT(daemon_->log(), HasSubstr("needs a restart: contact.debounce_frames, net.name"));
  EXPECT_EQ(daemon_->stop(SIGTERM), 0);
}

TEST_F(Reload, SaysThatNewCredentialsNeedARestart) {
  std::string handed_in = configuration("old", "");
  handed_in.replace(handed_in.find("'tokens'"), 8, "'credential:tokens'");
  write("dtactd.toml", handed_in);
  EXPECT_THAT(reload(), HasSubstr("; new credentials need a restart: net.tokens; listening"));
  EXPECT_THAT(daemon_->log(), HasSubstr("configuration read again, and with it the files of "
                                        "net.tls_certificate, net.tls_key; changed: "
                                        "net.tokens"));
  EXPECT_EQ(connect(old_, kOldToken)->server().rights(), v1::RIGHTS_CONTROL);
}

/// Runs dtactd until it fails. Returns its first message to the service manager.
std::optional<std::string> reported_by_failing(std::vector<std::string> arguments,
                                               std::string& output) {
  const TempFolder folder;
  const fakes::NotifySocket manager(folder.path() / "notify");
  ::setenv("NOTIFY_SOCKET", manager.path().c_str(), 1);
  arguments.insert(arguments.begin(), DTACTD_PROGRAM);
  EXPECT_EQ(run_program(arguments, &output), 1);
  ::unsetenv("NOTIFY_SOCKET");
  return manager.next(std::chrono::milliseconds(0));  // it has ended
}

// systemd accepts messages of the main process only, and complains of others.
TEST(Check, ReportsTheServiceManagerNothing) {
  std::string output;
  EXPECT_EQ(reported_by_failing({"--check-config", "--set", "camera.width=1"}, output),
            std::nullopt);
  EXPECT_THAT(output, HasSubstr("camera.width"));
}

// The status that systemctl shows of a daemon that cannot start.
TEST(Start, NamesTheCheckOfAConfigurationWithAMistake) {
  std::string output;
  const auto status = reported_by_failing({"--set", "camera.width=1"}, output);
  EXPECT_THAT(output, HasSubstr("once it is fixed, check it: dtactd --check-config"));
  EXPECT_THAT(status.value_or(""),
              AllOf(StartsWith("STATUS=--set: camera.width"), EndsWith("dtactd --check-config")));
}

/// Whether the process has opened the file to read it only. Until it runs its own program, it has
/// the descriptor with which this one writes.
bool reads(pid_t pid, const fs::path& file) {
  std::error_code ignored;  // one that is closed meanwhile
  for (const auto& entry : fs::directory_iterator(fmt::format("/proc/{}/fd", pid), ignored)) {
    if (fs::read_symlink(entry.path(), ignored) != file) continue;
    const fs::perms access = entry.symlink_status(ignored).permissions();
    if ((access & fs::perms::owner_write) == fs::perms::none) return true;
  }
  return false;
}

// Steps of a start take seconds on a slow board: it does not go on to serve.
TEST(Start, EndsWithTheStepInWhichItIsAskedTo) {
  const TempFolder folder;
  const fs::path scene = folder.path() / "scene.toml";
  ASSERT_EQ(::mkfifo(scene.c_str(), 0600), 0);
  base::UniqueFd writer(
      ::open(scene.c_str(), O_RDWR | O_CLOEXEC));  // the daemon waits for its text
  ASSERT_TRUE(writer);
  Program daemon({DTACTD_PROGRAM, "--set", "net.port=0", "--set",
                  "state_dir=" + folder.path().string(), "--set",
                  "camera.sim.scene=" + scene.string()});
  for (int i = 0; i < 6000 && !reads(daemon.pid(), scene); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_TRUE(reads(daemon.pid(), scene)) << daemon.log();
  ASSERT_EQ(::kill(daemon.pid(), SIGTERM), 0);
  writer.reset();  // an empty scene
  EXPECT_EQ(daemon.stop(0), 0);
  EXPECT_THAT(daemon.log(), AllOf(HasSubstr("SIGTERM: stopping"), Not(HasSubstr("listening"))));
}

class CheckOfFiles : public testing::Test {
 protected:
  void TearDown() override { ::unsetenv("CREDENTIALS_DIRECTORY"); }

  [[nodiscard]] std::string write(const std::string& name, const std::string& text) const {
    const fs::path file = folder_.path() / name;
    std::ofstream(file) << text;
    fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
    return file.string();
  }
  /// The errors of `dtactd --check-config` about [net]; empty without any.
  [[nodiscard]] static std::string check(const std::vector<std::string>& settings) {
    std::vector<std::string> command = {DTACTD_PROGRAM, "--check-config"};
    for (const std::string& setting : settings) {
      command.insert(command.end(), {"--set", "net." + setting});
    }
    std::string output;
    const int status = run_program(command, &output);
    EXPECT_EQ(status, output.empty() ? 0 : 1);
    return output;
  }

  TempFolder folder_;
};

// Otherwise `systemctl reload` would succeed although the daemon keeps its old settings.
TEST_F(CheckOfFiles, FindsBrokenTokens) {
  const std::string tokens = write("tokens", "view " + wire::token_hash(kNewToken) + "\n");
  EXPECT_EQ(check({"tokens=" + tokens}), "");
  (void)write("tokens", "view short\n");
  EXPECT_THAT(check({"tokens=" + tokens}),
              HasSubstr(tokens + ":1: a token itself must not be kept"));
  EXPECT_THAT(check({"tokens=" + tokens + "-gone"}), HasSubstr("tokens-gone: No such file"));
}

TEST_F(CheckOfFiles, FindsAKeyOfAnotherCertificate) {
  for (const char* name : {"left", "right"}) {
    ASSERT_EQ(run_program({DTACTCTL_PROGRAM, "cert", "-o", (folder_.path() / name).string()}), 0);
  }
  const std::string certificate = (folder_.path() / "left/dtactd.crt").string();
  const std::string key = (folder_.path() / "left/dtactd.key").string();
  const std::string other = (folder_.path() / "right/dtactd.key").string();
  EXPECT_EQ(check({"tls_certificate=" + certificate, "tls_key=" + key}), "");
  EXPECT_THAT(check({"tls_certificate=" + certificate, "tls_key=" + other}), HasSubstr(other));
  EXPECT_THAT(check({"tls_certificate=" + certificate}), HasSubstr("set both or none"));
}

TEST(Check, LooksAtTheCalibration) {
  std::string output;
  EXPECT_EQ(reported_by_failing({"--check-config", "--set", "calibration=/no/such"}, output),
            std::nullopt);
  EXPECT_THAT(output, HasSubstr("calibration = \"/no/such\": No such file or directory"));
}

TEST_F(CheckOfFiles, LooksAtCredentialsWhereThereAreAny) {
  const std::vector<std::string> all = {"tokens=credential:tokens", "tls_key=credential:key",
                                        "tls_certificate=credential:certificate"};
  EXPECT_EQ(check(all), "");
  ::setenv("CREDENTIALS_DIRECTORY", folder_.path().c_str(), 1);
  EXPECT_THAT(check({all[0]}), HasSubstr("/etc/credstore/dtactd.tokens"));
  (void)write("tokens", "view short\n");
  EXPECT_THAT(check({all[0]}), HasSubstr("tokens:1: a token itself must not be kept"));
}

TEST(Credentials, OneThatIsMissingNamesWhereToPutIt) {
  std::string output;
  const auto status = reported_by_failing({"--set", "net.tokens=credential:tokens", "--set",
                                           "camera.backend=null", "--set", "ring.backend=null"},
                                          output);
  EXPECT_THAT(output, AllOf(HasSubstr("/etc/credstore/dtactd.tokens"),
                            HasSubstr("what else this machine lacks: dtactd --doctor")));
  // The status that systemctl shows of a daemon that cannot start.
  EXPECT_THAT(status.value_or(""),
              AllOf(StartsWith("STATUS=net.tokens = "), EndsWith("dtactd --doctor")));
}

}  // namespace
}  // namespace dtact::e2e
