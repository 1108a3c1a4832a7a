// The values that --daemon accepts.
#include "clients/common/daemon_option.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace dtact::web {
namespace {

using cli::parse_daemons;

std::string complaint(const std::string& text) {
  try {
    (void)parse_daemons("--daemon", {text}, {});
  } catch (const std::exception& e) {
    return e.what();
  }
  return "";
}

TEST(DaemonOption, NameAndAddress) {
  client::Options common;
  common.port = 7399;
  common.token = "of --host alone";
  common.insecure = true;
  const cli::NamedDaemon made =
      parse_daemons("--daemon", {"left-1=unix:/run/x=y.sock"}, common).front();
  EXPECT_EQ(made.name, "left-1");
  EXPECT_EQ(made.options.host, "unix:/run/x=y.sock");
  EXPECT_EQ(made.options.port, 7399);
  EXPECT_EQ(made.options.token, "");
  EXPECT_FALSE(made.options.insecure);
  EXPECT_FALSE(made.options.tls);
}

TEST(DaemonOption, ProofOfWhoItIs) {
  const cli::NamedDaemon made =
      parse_daemons("--daemon", {"a=gripper:7377,fingerprint=3f00,ca-file=/ca.pem,insecure"}, {})
          .front();
  EXPECT_EQ(made.options.host, "gripper:7377");
  ASSERT_TRUE(made.options.tls);
  EXPECT_EQ(made.options.tls->fingerprint, "3f00");
  EXPECT_EQ(made.options.tls->ca_file, "/ca.pem");
  EXPECT_TRUE(made.options.insecure);
}

TEST(DaemonOption, NamesWhatMakesNoSense) {
  using testing::HasSubstr;
  EXPECT_THAT(complaint("gripper"), HasSubstr("--daemon gripper: it has to be NAME=ADDRESS"));
  EXPECT_THAT(complaint("=gripper"), HasSubstr("it has to be NAME=ADDRESS"));
  EXPECT_THAT(complaint("a="), HasSubstr("it has to be NAME=ADDRESS"));
  EXPECT_THAT(complaint("a/b=gripper"), HasSubstr("letters, digits"));
  EXPECT_THAT(complaint(std::string(65, 'a') + "=gripper"), HasSubstr("1 to 64"));
  EXPECT_THAT(complaint("a=b,colour=red"), HasSubstr("\"colour=red\" is not known"));
  EXPECT_THAT(complaint("a=b,fingerprint"), HasSubstr("\"fingerprint\" is not known"));
  EXPECT_THROW((void)parse_daemons("--daemon", {"a=b", "a=c"}, {}), std::runtime_error);
  EXPECT_THAT(complaint("a=b,token-file=/nowhere"), HasSubstr("/nowhere"));
}

}  // namespace
}  // namespace dtact::web
