#include "clients/common/avahi.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-bus.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <stop_token>
#include <string_view>
#include <thread>

#include "clients/ctl/ctl.hpp"
#include "hal/base/unique_fd.hpp"
#include "tests/fakes/own_path.hpp"
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

std::vector<std::string> names_of(const std::vector<cli::Finder::Found>& all) {
  std::vector<std::string> names;
  for (const auto& one : all) names.push_back(one.daemon.name);
  return names;
}

// Before: the third took the name of the second.
TEST(Finder, NamesOfThreeDaemonsDiffer) {
  cli::Finder finder({});
  EXPECT_THAT(
      names_of(finder.add({found("left", "a-b.local", 7377), found("left", "a b.local", 7377),
                           found("left", "a_b.local", 7377)})),
      testing::ElementsAre("a_b_left", "a_b_left_7377", "a_b_left_7378"));
}

TEST(Finder, MakesNoNameThatTheUserGave) {
  client::Options away;
  away.host = "unix:/no/such/socket";
  cli::Finder finder({}, {{"b_left_7378", away}});
  EXPECT_THAT(
      names_of(finder.add({found("left", "b.local", 7377), found("left", "b.local", 7378)})),
      testing::ElementsAre("b_left", "b_left_7379"));
}

TEST(Finder, FindsNoMoreThanItIsAskedFor) {
  cli::Finder finder({}, {}, 2);
  const std::vector<cli::FoundDaemon> all{found("a", "a.local", 1), found("b", "b.local", 2),
                                          found("c", "c.local", 3)};
  EXPECT_EQ(finder.add(all).size(), 2U);
  EXPECT_TRUE(finder.add(all).empty());
}

// Each is connected to on a thread. Before: 1000, and the services ended at about 245.
TEST(Finder, TheServicesHaveThreadsForAllThatAreFound) {
  for (const char* name : {"web", "dds"}) {
    std::ifstream unit(std::string(DTACT_SOURCE_DIR "/systemd/dtact-") + name + ".service");
    std::size_t tasks = 0;
    for (std::string line; std::getline(unit, line);) {
      if (line.starts_with("TasksMax=")) tasks = std::stoul(line.substr(line.find('=') + 1));
    }
    EXPECT_LE(cli::Finder::kMaxConnected + 50, tasks) << name;
  }
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

// Before: others whose names stood before its own kept it at an address that it had left.
TEST(Finder, FollowsWhatItKnowsWhateverElseIsAnnounced) {
  cli::Finder finder({}, {}, 1);
  auto known = found("left", "b.local", 7377);
  ASSERT_EQ(finder.add({known}).size(), 1U);
  known.set_address("192.0.2.8");
  const auto moved = finder.add({found("another", "a.local", 7377), known});
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_EQ(moved[0].daemon.options.host, "192.0.2.8");
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

/// A system bus with an avahi-daemon that lists daemons which were switched off, and "there" last.
class PlayedAvahi {
 public:
  explicit PlayedAvahi(int gone) : gone_(gone) {
    std::filesystem::remove(path_);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path - 1);
    if (::bind(listening_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listening_.get(), 8) != 0) {
      throw std::runtime_error("cannot listen on " + path_);
    }
    ::setenv("DBUS_SYSTEM_BUS_ADDRESS", ("unix:path=" + path_).c_str(), 1);
    thread_ = std::thread([this] { serve(); });
  }
  ~PlayedAvahi() {
    thread_.join();
    ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
    std::filesystem::remove(path_);
  }
  PlayedAvahi(const PlayedAvahi&) = delete;
  PlayedAvahi& operator=(const PlayedAvahi&) = delete;

 private:
  static void signal(sd_bus* bus, const char* member, const char* name) {
    sd_bus_message* made = nullptr;
    sd_bus_message_new_signal(bus, &made, "/browser", "org.freedesktop.Avahi.ServiceBrowser",
                              member);
    if (name != nullptr) {
      sd_bus_message_append(made, "iisssu", 1, 0, name, "_dtact._tcp", "local", 0U);
    }
    sd_bus_message_set_sender(made, "org.freedesktop.Avahi");
    sd_bus_send(bus, made, nullptr);
    sd_bus_message_unref(made);
  }

  static int answer(sd_bus_message* call, void* self, sd_bus_error*) {
    const char* called = sd_bus_message_get_member(call);
    const std::string_view member = called == nullptr ? "" : called;
    if (member == "Hello") return sd_bus_reply_method_return(call, "s", ":1.1");
    if (member == "ServiceBrowserNew") {
      sd_bus_reply_method_return(call, "o", "/browser");
      sd_bus* const bus = sd_bus_message_get_bus(call);
      for (int i = 0; i < static_cast<PlayedAvahi*>(self)->gone_; ++i) {
        signal(bus, "ItemNew", ("gone " + std::to_string(i)).c_str());
      }
      signal(bus, "ItemNew", "there");
      signal(bus, "AllForNow", nullptr);
      return 1;
    }
    if (member == "ResolveService") {
      int interface = 0;
      int protocol = 0;
      const char* name = nullptr;
      sd_bus_message_read(call, "iis", &interface, &protocol, &name);
      if (name == nullptr || name != std::string_view("there")) return 1;
      return sd_bus_reply_method_return(call, "iissssisqaayu", 1, 0, name, "_dtact._tcp", "local",
                                        "a.local", 0, "192.0.2.7", 7377, 0, 0U);
    }
    return sd_bus_reply_method_return(call, "");
  }

  void serve() {
    const int fd = ::accept4(listening_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    sd_bus* bus = nullptr;
    sd_id128_t id{};
    sd_id128_randomize(&id);
    sd_bus_new(&bus);
    sd_bus_set_fd(bus, fd, fd);
    sd_bus_set_server(bus, 1, id);
    sd_bus_add_filter(bus, nullptr, answer, this);
    sd_bus_start(bus);
    while (sd_bus_is_open(bus) > 0) {
      if (sd_bus_process(bus, nullptr) == 0) sd_bus_wait(bus, 100'000);
    }
    sd_bus_flush_close_unref(bus);
  }

  int gone_;
  std::string path_ = fakes::own_path().string() + ".bus";
  base::UniqueFd listening_{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  std::thread thread_;
};

using std::chrono::steady_clock;

// Before: each one that was switched off took Avahi's five seconds, one after the other.
TEST(Browse, DaemonsThatWereSwitchedOffHoldUpNoOther) {
  const PlayedAvahi avahi(100);
  const auto begin = steady_clock::now();
  const auto all = cli::browse(std::chrono::seconds(2));
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(10));
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].name(), "there");
  EXPECT_EQ(all[0].address(), "192.0.2.7");
  EXPECT_EQ(all[0].port(), 7377U);
}

TEST(Browse, StopsWhenItIsAsked) {
  const PlayedAvahi avahi(1);
  std::stop_source stop;
  stop.request_stop();
  const auto begin = steady_clock::now();
  (void)cli::browse(std::chrono::seconds(60), stop.get_token());
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(30));
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
