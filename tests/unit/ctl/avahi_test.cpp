#include "clients/common/avahi.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>

#include "clients/ctl/ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(Txt, IsRead) {
  cli::FoundDaemon found;
  cli::read_txt({"version=1.2.3", "instance=f00d", "serial=A=\x1b[2J\xff", "tls=1", "token=0",
                 "colour=red", "odd", ""},
                found);
  EXPECT_EQ(found.version(), "1.2.3");
  EXPECT_EQ(found.serial(), "A=?[2J?");
  EXPECT_EQ(found.instance(), "f00d");
  EXPECT_TRUE(found.tls());
  EXPECT_FALSE(found.token());
}

cli::FoundDaemon found(const std::string& name, const std::string& host, unsigned port) {
  cli::FoundDaemon one;
  one.set_name(name);
  one.set_host(host);
  one.set_address("192.0.2.7");
  one.set_port(port);
  return one;
}

// Names are parts of addresses and topics, whatever the network says.
TEST(Finder, NamesEachDaemonOnce) {
  cli::Finder finder({});
  auto secret = found("7 left\xc3\xa4", "a.local", 7379);
  secret.set_tls(true);
  const auto all =
      finder.add({found("a-hand", "a-hand.local", 7377), found("left", "b.local", 7377),
                  found("left #2", "b.local", 7378), found("left", "b.local", 7377),
                  found("", "", 1), found(std::string(99, 'x'), "c.local", 7377), secret});
  std::vector<std::string> names;
  for (const auto& one : all) names.push_back(one.daemon.name);
  EXPECT_THAT(names, testing::ElementsAre("a_hand", "b_left", "b_left_7378", "sensor",
                                          "c_" + std::string(56, 'x'), "a_7_left"));
  EXPECT_EQ(all[2].daemon.options.host, "192.0.2.7");
  EXPECT_EQ(all[2].daemon.options.port, 7378);
  EXPECT_EQ(all[2].refused, "");
  EXPECT_EQ(all[5].refused, "a_7_left at a.local:7379 asks for TLS: name it with --daemon");
  EXPECT_TRUE(finder.add({found("other", "b.local", 7378)}).empty());
}

// DHCP gives addresses, and a machine may have several.
TEST(Finder, FollowsADaemonToAnotherAddress) {
  cli::Finder finder({});
  auto one = found("left", "a.local", 7377);
  auto other = one;
  other.set_address("192.0.2.8");
  EXPECT_EQ(finder.add({one, other}).size(), 1U);
  EXPECT_TRUE(finder.add({other, one}).empty());
  EXPECT_TRUE(finder.add({}).empty());
  const auto moved = finder.add({other});
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_EQ(moved[0].daemon.name, "a_left");
  EXPECT_EQ(moved[0].daemon.options.host, "192.0.2.8");
  EXPECT_TRUE(finder.add({other}).empty());
}

TEST(Finder, LeavesOutThoseThatWereNamed) {
  net::NetConfig config;
  config.instance = "f00d";
  const net::test::Rig rig(config);
  client::Options options;
  options.port = rig.tcp_port();
  client::Options away;
  away.host = "unix:/no/such/socket";
  cli::Finder finder({}, {{"mine", options}, {"b_left", away}});
  auto same = found("left", "a.local", 7377);
  same.set_instance("f00d");
  auto another = found("right", "a.local", 7378);
  another.set_instance("beef");
  const auto all = finder.add({same, found("left", "b.local", 7377), another});
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].daemon.name, "a_right");
  same.set_address("192.0.2.8");
  EXPECT_TRUE(finder.add({same, another}).empty());
}

TEST(Find, SaysThatThereIsNoAvahi) {
  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/no/such/bus", 1);
  std::ostringstream out;
  std::ostringstream error;
  EXPECT_EQ(run({"find"}, out, error), 1);
  EXPECT_THAT(error.str(), AllOf(HasSubstr("no avahi-daemon to ask (no system bus: "),
                                 HasSubstr("apt-get install avahi-daemon, or name daemons "
                                           "with --host or --daemon")));
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
}

}  // namespace
}  // namespace dtact::ctl
