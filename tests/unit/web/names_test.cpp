// The host names and origins that the server accepts from browsers.
#include "clients/web/names.hpp"

#include <gtest/gtest.h>

namespace dtact::web {
namespace {

TEST(Hosts, AddressesLocalhostAndOwnNames) {
  for (const char* host : {"127.0.0.1", "127.0.0.1:7380", "192.0.2.7:1", "[::1]", "[fe80::1]:7380",
                           "localhost", "LocalHost:80", "gripper", "GRIPPER:7380"}) {
    EXPECT_TRUE(is_own_host(host, {"gripper"})) << host;
  }
}

TEST(Hosts, AnOwnNameMayBeGivenWithAPort) {
  EXPECT_EQ(without_port("gripper:7380"), "gripper");
  EXPECT_EQ(without_port("[fe80::1]:7380"), "fe80::1");
  EXPECT_TRUE(is_own_host("gripper:7380", {"gripper:7380"}));
  EXPECT_TRUE(is_own_host("gripper", {"gripper:7380"}));
  EXPECT_FALSE(is_own_host(":7380", {":7380"}));
}

TEST(Hosts, NamesThatOthersChoose) {
  for (const char* host : {"", ":7380", "evil.example", "127.0.0.1.evil.example", "localhost.",
                           "localhost.evil.example", "gripper.evil.example", "[::1", "gripper2"}) {
    EXPECT_FALSE(is_own_host(host, {"gripper"})) << host;
  }
}

TEST(Origins, TheOneThatThePageCameFrom) {
  EXPECT_TRUE(is_own_origin("http://localhost:7380", "localhost:7380", false, {}));
  EXPECT_TRUE(is_own_origin("https://Gripper", "gripper", true, {}));
  EXPECT_TRUE(is_own_origin("https://robot.example", "robot.example", false, {}));
  EXPECT_TRUE(is_own_origin("file://", "localhost:7380", false, {"file://"}));
}

TEST(Origins, AnyOther) {
  EXPECT_FALSE(is_own_origin("http://localhost:7380", "localhost:7380", true, {}));
  EXPECT_FALSE(is_own_origin("http://localhost", "localhost:7380", false, {}));
  EXPECT_FALSE(is_own_origin("http://127.0.0.1:7380", "localhost:7380", false, {}));
  EXPECT_FALSE(is_own_origin("null", "localhost:7380", false, {"file://"}));
  EXPECT_FALSE(is_own_origin("", "", false, {}));
}

}  // namespace
}  // namespace dtact::web
