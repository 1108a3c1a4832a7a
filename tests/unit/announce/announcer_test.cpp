#include "daemon/announce/announcer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-bus.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::announce {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// avahi-common/defs.h: AvahiEntryGroupState.
constexpr std::int32_t kEstablished = 2;
constexpr std::int32_t kCollision = 3;
constexpr std::int32_t kFailure = 4;

/// One service as avahi-daemon is asked to add it.
struct Added {
  std::string name;
  std::string type;
  std::string domain;
  std::string host;
  int interface = 0;
  int protocol = 0;
  std::uint32_t flags = 1;
  std::uint16_t port = 0;
  std::vector<std::string> txt;
};

/// What avahi-daemon answers. Both lists are used from the front; beyond their end the service is
/// added and established.
struct Script {
  bool runs = true;                         ///< avahi-daemon is on the bus.
  bool dies = false;                        ///< At the first AddService, after its answer.
  std::deque<std::string> add_errors = {};  ///< D-Bus error of AddService; "" = none.
  std::deque<std::int32_t> states = {};     ///< Of the group after Commit.
};

/// A system bus with an avahi-daemon that follows a script. Serves one connection after another.
class BusDouble {
 public:
  explicit BusDouble(Script script, const std::string& ending = "")
      : path_(fakes::own_path().string() + ending + ".bus"), script_(std::move(script)) {
    std::filesystem::remove(path_);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path - 1);
    if (::bind(listening_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listening_.get(), 8) != 0) {
      throw std::runtime_error("cannot listen on " + path_);
    }
    ::setenv("DBUS_SYSTEM_BUS_ADDRESS", ("unix:path=" + path_).c_str(), 1);
    thread_ = std::thread([this] { run(); });
  }
  ~BusDouble() {
    stop_ = true;
    thread_.join();
    ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
    std::filesystem::remove(path_);
  }
  BusDouble(const BusDouble&) = delete;
  BusDouble& operator=(const BusDouble&) = delete;

  /// The members that were called, without those of the bus' own connection.
  [[nodiscard]] std::vector<std::string> calls() const {
    const std::lock_guard lock(mutex_);
    return calls_;
  }
  [[nodiscard]] std::vector<Added> added() const {
    const std::lock_guard lock(mutex_);
    return added_;
  }
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const Added& one : added()) all.push_back(one.name);
    return all;
  }
  [[nodiscard]] std::ptrdiff_t count(const std::string& member) const {
    const std::vector<std::string> all = calls();
    return std::ranges::count(all, member);
  }
  /// avahi-daemon ends or comes back.
  void set_running(bool runs) {
    const std::lock_guard lock(mutex_);
    script_.runs = runs;
    owner_changed_ = true;
  }
  /// The bus closes the connection.
  void hang_up() { hang_up_ = true; }
  /// Connections that have ended.
  [[nodiscard]] int ended() const { return ended_; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  static int answer(sd_bus_message* call, void* self, sd_bus_error*) {
    const char* name = sd_bus_message_get_member(call);
    return static_cast<BusDouble*>(self)->reply(call, name == nullptr ? "" : name);
  }

  int reply(sd_bus_message* call, const std::string& member) {
    if (member == "Hello") return sd_bus_reply_method_return(call, "s", ":1.1");
    if (member == "AddMatch") return sd_bus_reply_method_return(call, "");
    const std::lock_guard lock(mutex_);
    calls_.push_back(member);
    if (member == "NameHasOwner") {
      return sd_bus_reply_method_return(call, "b", script_.runs ? 1 : 0);
    }
    if (member == "EntryGroupNew") {
      return sd_bus_reply_method_return(call, "o", ("/group" + std::to_string(++groups_)).c_str());
    }
    if (member == "AddService") {
      added_.push_back(read(call));
      // After this answer nobody reads what the program writes.
      if (script_.dies) {
        ::shutdown(sd_bus_get_fd(sd_bus_message_get_bus(call)), SHUT_RD);
        dead_ = true;
      }
      const std::string error = next(script_.add_errors, std::string());
      if (!error.empty()) return sd_bus_reply_method_errorf(call, error.c_str(), "it is taken");
      return sd_bus_reply_method_return(call, "");
    }
    const int result = sd_bus_reply_method_return(call, "");
    if (member == "Commit") {
      // Of another program's group: it says nothing of this one.
      signal(call, "/other", kFailure, "not ours");
      signal(call, sd_bus_message_get_path(call), next(script_.states, kEstablished), "no room");
    }
    return result;
  }

  template <typename T>
  static T next(std::deque<T>& list, T otherwise) {
    if (list.empty()) return otherwise;
    T front = std::move(list.front());
    list.pop_front();
    return front;
  }

  static Added read(sd_bus_message* call) {
    Added added;
    const char* name = nullptr;
    const char* type = nullptr;
    const char* domain = nullptr;
    const char* host = nullptr;
    sd_bus_message_read(call, "iiussssq", &added.interface, &added.protocol, &added.flags, &name,
                        &type, &domain, &host, &added.port);
    added.name = name;
    added.type = type;
    added.domain = domain;
    added.host = host;
    sd_bus_message_enter_container(call, 'a', "ay");
    const void* bytes = nullptr;
    for (std::size_t size = 0; sd_bus_message_read_array(call, 'y', &bytes, &size) > 0;) {
      added.txt.emplace_back(static_cast<const char*>(bytes), size);
    }
    return added;
  }

  static void signal(sd_bus_message* call, const char* path, std::int32_t state,
                     const char* error) {
    sd_bus* bus = sd_bus_message_get_bus(call);
    sd_bus_message* made = nullptr;
    sd_bus_message_new_signal(bus, &made, path, "org.freedesktop.Avahi.EntryGroup", "StateChanged");
    sd_bus_message_set_sender(made, "org.freedesktop.Avahi");
    sd_bus_message_append(made, "is", state, error);
    sd_bus_send(bus, made, nullptr);
    sd_bus_message_unref(made);
  }

  void report_owner(sd_bus* bus) {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(owner_changed_, false)) return;
    sd_bus_message* made = nullptr;
    sd_bus_message_new_signal(bus, &made, "/org/freedesktop/DBus", "org.freedesktop.DBus",
                              "NameOwnerChanged");
    sd_bus_message_set_sender(made, "org.freedesktop.DBus");
    sd_bus_message_append(made, "sss", "org.freedesktop.Avahi", script_.runs ? "" : ":1.7",
                          script_.runs ? ":1.7" : "");
    sd_bus_send(bus, made, nullptr);
    sd_bus_message_unref(made);
  }

  void run() {
    while (!stop_) {
      pollfd waiting{.fd = listening_.get(), .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, 10) > 0) serve();
    }
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
    while (!dead_ && !stop_ && !hang_up_ && sd_bus_is_open(bus) > 0) {
      const int result = sd_bus_process(bus, nullptr);
      if (result < 0) break;
      if (result > 0) continue;
      report_owner(bus);
      sd_bus_wait(bus, 10'000);
    }
    hang_up_ = false;
    sd_bus_flush_close_unref(bus);
    ++ended_;
  }

  std::string path_;
  base::UniqueFd listening_{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  mutable std::mutex mutex_;
  Script script_;  // under the mutex, like the next four
  std::vector<std::string> calls_;
  std::vector<Added> added_;
  int groups_ = 0;
  bool owner_changed_ = false;
  std::atomic<bool> dead_{false};
  std::atomic<bool> hang_up_{false};
  std::atomic<bool> stop_{false};
  std::atomic<int> ended_{0};
  std::thread thread_;
};

/// Runs `io` until `done`; false when that takes a minute.
template <typename Condition>
bool run_until(boost::asio::io_context& io, Condition done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    io.run_one_for(std::chrono::milliseconds(10));
    if (!io.stopped()) continue;
    // It has no work left, and would not wait.
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    io.restart();
  }
  return true;
}

/// An announcer and what it logs.
struct Announced {
  explicit Announced(boost::asio::io_context& io,
                     Service first = {.name = "left", .port = 7377, .txt = {}})
      : service(std::move(first)),
        announcer(
            io, [this] { return this->service; },
            [this](const std::string& line) { log.push_back(line); }) {}

  Service service;
  std::vector<std::string> log;
  Announcer announcer;
};

// The next call goes to a bus that is closed.
TEST(Announcer, ABusThatGoesInTheMiddleIsReportedAndThrowsNothing) {
  boost::asio::io_context io;
  std::string reported;
  {
    const BusDouble bus({.dies = true, .add_errors = {"org.freedesktop.Avahi.CollisionError"}});
    Announcer announcer(
        io, [] { return Service{.name = "left", .port = 7377, .txt = {}}; },
        [&](const std::string& line) {
          reported += line + "\n";
          if (line.find("no system bus") != std::string::npos) io.stop();
        });
    EXPECT_NO_THROW(io.run_for(std::chrono::seconds(10)));
    announcer.stop();
  }
  EXPECT_NE(reported.find("the service is not announced: no system bus"), std::string::npos)
      << reported;
}

TEST(Announcer, AsksAvahiToPublishTheServiceAndSaysSo) {
  const BusDouble bus({});
  boost::asio::io_context io;
  Announced left(io, {.name = "left",
                      .port = 7388,
                      .interface = 3,
                      .protocol = 0,
                      .txt = {"version=0.1.0", "serial=", "token=1"}});
  ASSERT_TRUE(run_until(io, [&] { return !left.log.empty(); }));
  EXPECT_THAT(left.log, ElementsAre("announced as \"left\" (_dtact._tcp, port 7388)"));
  EXPECT_THAT(bus.calls(), ElementsAre("NameHasOwner", "EntryGroupNew", "AddService", "Commit"));
  const std::vector<Added> added = bus.added();
  ASSERT_EQ(added.size(), 1U);
  EXPECT_EQ(added[0].name, "left");
  EXPECT_EQ(added[0].type, "_dtact._tcp");
  EXPECT_EQ(added[0].domain, "");
  EXPECT_EQ(added[0].host, "");
  EXPECT_EQ(added[0].interface, 3);
  EXPECT_EQ(added[0].protocol, 0);
  EXPECT_EQ(added[0].flags, 0U);
  EXPECT_EQ(added[0].port, 7388);
  EXPECT_THAT(added[0].txt, ElementsAre("version=0.1.0", "serial=", "token=1"));
  left.announcer.stop();
  ASSERT_TRUE(run_until(io, [&] { return bus.ended() == 1; }));
  EXPECT_EQ(left.log.size(), 1U);
}

// The first time another daemon of this machine has the name, the second time another machine.
// With its number a name still has the 63 bytes that DNS allows.
TEST(Announcer, ANameThatIsTakenGetsTheNextNumber) {
  const BusDouble bus({.add_errors = {"org.freedesktop.Avahi.CollisionError"},
                       .states = {kCollision, kEstablished}});
  boost::asio::io_context io;
  const Announced left(io, {.name = std::string(70, 'x'), .port = 7377, .txt = {}});
  ASSERT_TRUE(run_until(io, [&] { return !left.log.empty(); }));
  EXPECT_THAT(left.log, ElementsAre(HasSubstr('"' + std::string(60, 'x') +
                                              " #3\" (_dtact._tcp, port 7377)")));
  EXPECT_THAT(bus.names(), ElementsAre(std::string(63, 'x'), std::string(60, 'x') + " #2",
                                       std::string(60, 'x') + " #3"));
  EXPECT_EQ(bus.count("Free"), 2) << "nothing is left of the other two";
}

TEST(Announcer, SaysOnceThatAvahiIsMissingAndSeesItComeAndGo) {
  BusDouble bus({.runs = false});
  boost::asio::io_context io;
  const Announced left(io);
  ASSERT_TRUE(run_until(io, [&] { return !left.log.empty(); }));
  EXPECT_THAT(left.log, ElementsAre(HasSubstr("not announced until avahi-daemon runs (apt-get "
                                              "install avahi-daemon, or net.announce = false)")));
  EXPECT_THAT(bus.calls(), ElementsAre("NameHasOwner")) << "a call would start it";
  bus.set_running(true);
  ASSERT_TRUE(run_until(io, [&] { return left.log.size() == 2; }));
  EXPECT_EQ(left.log[1], "announced as \"left\" (_dtact._tcp, port 7377)");
  bus.set_running(false);
  run_until(io, [&, i = 0]() mutable { return ++i > 20; });
  EXPECT_EQ(bus.count("EntryGroupNew"), 1) << "nobody is there to ask";
  bus.set_running(true);
  ASSERT_TRUE(run_until(io, [&] { return bus.count("Commit") == 2; }));
  EXPECT_THAT(bus.names(), ElementsAre("left", "left"));
  EXPECT_EQ(left.log.size(), 2U) << "the same again is no news";
}

TEST(Announcer, WhatAvahiRefusesIsReportedAndTakenBack) {
  const BusDouble bus({.add_errors = {"org.freedesktop.Avahi.InvalidServiceNameError"}});
  boost::asio::io_context io;
  const Announced left(io);
  ASSERT_TRUE(run_until(io, [&] { return bus.count("Free") == 1; }));
  EXPECT_THAT(left.log, ElementsAre("the service is not announced: it is taken"));
  EXPECT_EQ(bus.count("Commit"), 0);
}

// Each is looked at again after fifteen seconds; the four wait for them together.
TEST(Announcer, LooksAgainAfterAWhile) {
  boost::asio::io_context io;
  const BusDouble failing({.states = {kFailure, kEstablished}}, "_failing");
  const Announced failed(io);
  const BusDouble one({}, "_one");
  Announced changed(io);
  BusDouble ending({}, "_ending");
  const Announced lost(io);
  const BusDouble other({}, "_other");
  const Announced same(io);
  ASSERT_TRUE(run_until(io, [&] {
    return !failed.log.empty() && !changed.log.empty() && !lost.log.empty() && !same.log.empty();
  }));
  EXPECT_EQ(failed.log.back(), "the service is not announced: no room");
  changed.service.name = "right";
  ending.hang_up();
  ASSERT_TRUE(run_until(io, [&] { return lost.log.size() == 2; }));
  EXPECT_THAT(lost.log[1], HasSubstr("the service is not announced: no system bus ("));
  EXPECT_EQ(failing.count("NameHasOwner"), 1);

  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", ("unix:path=" + ending.path()).c_str(), 1);
  ASSERT_TRUE(run_until(io, [&] {
    return failed.log.size() == 2 && changed.log.size() == 2 && lost.log.size() == 3;
  }));
  EXPECT_EQ(failed.log[1], "announced as \"left\" (_dtact._tcp, port 7377)");
  EXPECT_THAT(failing.calls(),
              ElementsAre("NameHasOwner", "EntryGroupNew", "AddService", "Commit", "Free",
                          "NameHasOwner", "EntryGroupNew", "AddService", "Commit"));
  EXPECT_EQ(changed.log[1], "announced as \"right\" (_dtact._tcp, port 7377)");
  EXPECT_THAT(one.calls(), ElementsAre("NameHasOwner", "EntryGroupNew", "AddService", "Commit",
                                       "Free", "EntryGroupNew", "AddService", "Commit"));
  EXPECT_EQ(lost.log[2], "announced as \"left\" (_dtact._tcp, port 7377)");
  EXPECT_EQ(other.calls().size(), 4U) << "nothing has changed there";
}

TEST(Announcer, LivesWithoutASystemBus) {
  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent/bus", 1);
  boost::asio::io_context io;
  const Announced left(io);
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
  EXPECT_THAT(left.log, ElementsAre("the service is not announced: no system bus (No such file or "
                                    "directory)"));
}

}  // namespace
}  // namespace dtact::announce
