// dtactctl cert and dtactctl token.
#include "clients/ctl/secrets.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <regex>
#include <sstream>
#include <string>

#include "clients/ctl/certificate.hpp"
#include "daemon/serve/tls.hpp"
#include "daemon/serve/tokens.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/ctl/run_ctl.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using calibration::TempFolder;
using test::ctl;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::MatchesRegex;

/// The openssl command's description of a certificate.
std::string described(const fs::path& certificate) {
  const std::string command = "openssl x509 -noout -text -in '" + certificate.string() + "'";
  FILE* pipe = ::popen(command.c_str(), "r");
  std::string text;
  for (int c = 0; pipe != nullptr && (c = std::fgetc(pipe)) != EOF;) text += static_cast<char>(c);
  if (pipe != nullptr) ::pclose(pipe);
  return text;
}

TEST(Cert, MakesAPairThatTheDaemonTakes) {
  const TempFolder folder;
  const fs::path made = folder.path() / "new" / "tls";
  const auto result = ctl({"cert", "-o", made.string(), "--name", "gripper.lab.example", "--name",
                           "192.0.2.7", "--name", "2001:db8::7"});
  ASSERT_EQ(result.code, 0) << result.error;
  const net::Tls tls(made / "dtactd.crt", made / "dtactd.key");
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("tls_certificate = \"" + (made / "dtactd.crt").string() + "\"\n"),
                    HasSubstr("tls_key = \"" + (made / "dtactd.key").string() + "\"\n"),
                    HasSubstr("--fingerprint " + tls.fingerprint + "\n")));
  struct stat status{};
  ASSERT_EQ(::stat((made / "dtactd.key").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  const std::string text = described(made / "dtactd.crt");
  EXPECT_THAT(text, AllOf(HasSubstr("DNS:gripper.lab.example"), HasSubstr("IP Address:192.0.2.7"),
                          HasSubstr("IP Address:2001:DB8:0:0:0:0:0:7"), HasSubstr("DNS:localhost"),
                          HasSubstr("IP Address:127.0.0.1"), HasSubstr("prime256v1"),
                          ContainsRegex("CN ?= ?gripper.lab.example"), HasSubstr("CA:FALSE")));
}

TEST(Cert, ReplacesAPairOnlyOnRequest) {
  const TempFolder folder;
  const std::string path = folder.path().string();
  ASSERT_EQ(ctl({"cert", "-o", path}).code, 0);
  const std::string first = base::read_file(folder.path() / "dtactd.crt");
  const auto again = ctl({"cert", "-o", path});
  EXPECT_EQ(again.code, 1);
  EXPECT_THAT(again.error, AllOf(HasSubstr("dtactd.crt is there already"), HasSubstr("--force")));
  EXPECT_EQ(base::read_file(folder.path() / "dtactd.crt"), first);
  fs::remove(folder.path() / "dtactd.crt");
  EXPECT_THAT(ctl({"cert", "-o", path}).error, HasSubstr("dtactd.key is there already"));
  EXPECT_EQ(ctl({"cert", "-o", path, "--force"}).code, 0);
  EXPECT_NE(base::read_file(folder.path() / "dtactd.crt"), first);
}

// The digest of DER: `openssl x509 -fingerprint -sha256`.
TEST(Cert, ShowsAFingerprint) {
  const TempFolder folder;
  const fs::path file = folder.path() / "crt";
  base::write_file_atomically(file,
                              "-----BEGIN CERTIFICATE-----\n"
                              "MIIBeDCCAR+gAwIBAgIUVgR9eeXotgWB3MYtdSpjjSuhtTAwCgYIKoZIzj0EAwIw\n"
                              "ETEPMA0GA1UEAwwGc2FtcGxlMCAXDTI2MTEyMjEyMjM1NFoYDzIxMjYxMDI5MTIy\n"
                              "MzU0WjARMQ8wDQYDVQQDDAZzYW1wbGUwWTATBgcqhkjOPQIBBggqhkjOPQMBBwNC\n"
                              "AATuFdSIqAzSJvzzyJf85divXTERoAhJL37aUYLojZLcQ9Nmj4GMSDm0rMgYd5L7\n"
                              "sJQLcq2Heo6PrN87B0HPSo12o1MwUTAdBgNVHQ4EFgQU7ulpYLj2pX0c+DqoHCLp\n"
                              "LZCx+l4wHwYDVR0jBBgwFoAU7ulpYLj2pX0c+DqoHCLpLZCx+l4wDwYDVR0TAQH/\n"
                              "BAUwAwEB/zAKBggqhkjOPQQDAgNHADBEAiAbWYIykQar4SxsFMiztsxbry2IM/wl\n"
                              "XMQZnQ9EIx+G7AIgdW96Qq6Tw6szg0HGEdSo/vkX40ZZKUVhgdHWG3tOgP8=\n"
                              "-----END CERTIFICATE-----\n");
  const auto shown = ctl({"cert", "--show", file.string()});
  EXPECT_EQ(shown.code, 0) << shown.error;
  EXPECT_EQ(shown.out, "3cdcd5cc9cdf11e8386bf7215a76c0177082620306109ef45d63733f18edfc3a\n");
  base::write_file_atomically(file, "nothing");
  EXPECT_THAT(ctl({"cert", "--show", file.string()}).error, HasSubstr("is no PEM certificate"));
}

TEST(Cert, SaysWhatItNeeds) {
  EXPECT_EQ(ctl({"cert"}).code, 2);
  EXPECT_EQ(ctl({"cert", "-o", "/tmp", "--show", "x"}).code, 2);
  const TempFolder folder;
  for (const char* name : {"a,IP:1.2.3.4", "", "a b", "1.2.3.4/24"}) {
    const auto result = ctl({"cert", "-o", folder.path().string(), "--name", name});
    EXPECT_EQ(result.code, 1) << name;
    EXPECT_THAT(result.error, HasSubstr("is neither a host name nor an IPv4 or IPv6 address"));
  }
}

TEST(Token, IsInTheClientsFileAndItsHashInTheLine) {
  const TempFolder folder;
  const fs::path file = folder.path() / "arm.token";
  const auto result = ctl({"token", "--new", "view", "--name", "arm_left", "-o", file.string()});
  ASSERT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out, MatchesRegex("view sha256:[0-9a-f]{64} arm_left\n"));
  const std::string token = client::read_token(file);
  EXPECT_THAT(token, MatchesRegex("[0-9a-f]{64}"));
  const auto grant = net::Tokens(result.out, "f").find(token);
  ASSERT_TRUE(grant.has_value());
  EXPECT_EQ(grant->rights, net::Rights::view);
  EXPECT_EQ(grant->name, "arm_left");
  // The same line can be had again, for other rights too; the client keeps its token.
  EXPECT_EQ(
      ctl({"token", "--hash", "view", "--name", "arm_left", "--token-file", file.string()}).out,
      result.out);
  EXPECT_THAT(ctl({"token", "--new", "view", "-o", file.string()}).error,
              HasSubstr("arm.token is there already, and a client may use it"));
  EXPECT_EQ(client::read_token(file), token);
  EXPECT_NE(ctl({"token", "--new", "view", "-o", file.string() + "2"}).out.substr(0, 76),
            result.out.substr(0, 76));
}

TEST(Token, IsHashedOnlyIfItCannotBeGuessed) {
  const TempFolder folder;
  const fs::path file = folder.path() / "token";
  base::write_file_atomically(file, std::string(31, 'x') + "\n", 0600);
  EXPECT_THAT(ctl({"token", "--hash", "view", "--token-file", file.string()}).error,
              HasSubstr("has 31 bytes, its hash would reveal one with fewer than 32"));
  base::write_file_atomically(file, std::string(32, 'x') + "\n", 0600);
  EXPECT_EQ(ctl({"token", "--hash", "control", "--token-file", file.string()}).out,
            "control sha256:c62e4615bd39e222572f3a1bf7c2132ea1e65b17ec805047bd6b2842c593493f\n");
  EXPECT_THAT(ctl({"token", "--hash", "view"}).error, HasSubstr("has 0 bytes"));
}

TEST(Token, SaysWhatItNeeds) {
  EXPECT_EQ(ctl({"token"}).code, 2);
  EXPECT_EQ(ctl({"token", "--new", "all", "-o", "x"}).code, 2);
  EXPECT_EQ(ctl({"token", "--new", "view"}).code, 2);
  EXPECT_EQ(ctl({"token", "--new", "view", "-o", "x", "--hash", "view"}).code, 2);
  EXPECT_EQ(ctl({"token", "--new", "view", "-o", "x", "--name", "a b"}).code, 2);
}

}  // namespace
}  // namespace dtact::ctl
