#include "daemon/announce/announcer.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-bus.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>

#include "hal/base/unique_fd.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::announce {
namespace {

/// A system bus with an avahi-daemon that reports a name collision and then closes the connection.
class DyingBus {
 public:
  DyingBus() {
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
  ~DyingBus() {
    thread_.join();
    ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
    std::filesystem::remove(path_);
  }
  DyingBus(const DyingBus&) = delete;
  DyingBus& operator=(const DyingBus&) = delete;

 private:
  static int answer(sd_bus_message* call, void* self, sd_bus_error*) {
    const char* name = sd_bus_message_get_member(call);
    const std::string_view member = name == nullptr ? "" : name;
    if (member == "Hello") return sd_bus_reply_method_return(call, "s", ":1.1");
    if (member == "NameHasOwner") return sd_bus_reply_method_return(call, "b", 1);
    if (member == "EntryGroupNew") return sd_bus_reply_method_return(call, "o", "/group");
    if (member == "AddService") {
      // After this answer nobody reads what the program writes.
      ::shutdown(sd_bus_get_fd(sd_bus_message_get_bus(call)), SHUT_RD);
      static_cast<DyingBus*>(self)->dead_ = true;
      return sd_bus_reply_method_errorf(call, "org.freedesktop.Avahi.CollisionError", "taken");
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
    while (!dead_ && sd_bus_is_open(bus) > 0) {
      if (sd_bus_process(bus, nullptr) == 0) sd_bus_wait(bus, 100'000);
    }
    sd_bus_flush_close_unref(bus);
  }

  std::string path_ = fakes::own_path().string() + ".bus";
  base::UniqueFd listening_{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  bool dead_ = false;
  std::thread thread_;
};

// The next call goes to a bus that is closed.
TEST(Announcer, ABusThatGoesInTheMiddleIsReportedAndThrowsNothing) {
  boost::asio::io_context io;
  std::string reported;
  {
    const DyingBus bus;
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

}  // namespace
}  // namespace dtact::announce
