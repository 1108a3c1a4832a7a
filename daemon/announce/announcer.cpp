#include "daemon/announce/announcer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <systemd/sd-bus.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <utility>

#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"

namespace dtact::announce {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

// Avahi's D-Bus interface: avahi-daemon/org.freedesktop.Avahi.{Server,EntryGroup}.xml and
// avahi-common/defs.h of its source.
constexpr const char* kAvahi = "org.freedesktop.Avahi";
constexpr const char* kServer = "org.freedesktop.Avahi.Server";
constexpr const char* kGroup = "org.freedesktop.Avahi.EntryGroup";
constexpr const char* kBus = "org.freedesktop.DBus";
constexpr std::int32_t kEstablished = 2;
constexpr std::int32_t kCollision = 3;
constexpr std::int32_t kFailure = 4;

/// A system bus that comes later is seen, and a service that changed, within so long.
constexpr std::chrono::seconds kInterval{15};
constexpr std::size_t kMaxName = 63;  // bytes of a DNS label

struct Unref {
  void operator()(sd_bus* bus) const noexcept { sd_bus_close_unref(bus); }
  void operator()(sd_bus_message* message) const noexcept { sd_bus_message_unref(message); }
};
using Bus = std::unique_ptr<sd_bus, Unref>;
using Message = std::unique_ptr<sd_bus_message, Unref>;

/// Throws what a negative result of sd-bus means.
void check(int result) {
  if (result < 0) throw std::runtime_error(std::strerror(-result));
}

std::string text_of(const sd_bus_error* error) {
  return error->message == nullptr ? error->name : error->message;
}

}  // namespace

struct Announcer::Impl : std::enable_shared_from_this<Impl> {
  Impl(asio::io_context& io, Ask ask_service, Log log_line)
      : descriptor(io), timer(io), ask(std::move(ask_service)), log(std::move(log_line)) {}

  void tick();
  void connect();
  /// Everything that the bus has for us, and whom to wait for.
  void pump();
  void wait(asio::posix::stream_descriptor::wait_type what);
  void lose(const std::string& reason);

  void look_for_avahi();
  void publish();
  void add_service(const char* path);
  void commit();
  void withdraw();
  void on_state(std::int32_t state, const std::string& error);
  void set_state(const std::string& line);

  /// sd-bus' callback for member `handler`, which gets a reply or signal that is no error.
  template <void (Impl::*handler)(sd_bus_message*)>
  static int on(sd_bus_message* message, void* self, sd_bus_error*) {
    auto& impl = *static_cast<Impl*>(self);
    // Nothing may be thrown through sd-bus, nor out of io.run().
    try {
      impl.answer(message, handler);
    } catch (const std::exception& e) {
      impl.set_state(std::string("the service is not announced: ") + e.what());
    }
    return 0;
  }
  void answer(sd_bus_message* message, void (Impl::*handler)(sd_bus_message*)) {
    // Of AddService, where another daemon of this machine has the name.
    if (sd_bus_message_is_method_error(message, "org.freedesktop.Avahi.CollisionError") > 0) {
      return on_state(kCollision, "");
    }
    if (sd_bus_message_is_method_error(message, nullptr) > 0) {
      withdraw();
      return set_state("the service is not announced: " +
                       text_of(sd_bus_message_get_error(message)));
    }
    (this->*handler)(message);
  }
  void on_owner_changed(sd_bus_message* message);
  void on_has_owner(sd_bus_message* message);
  void on_group(sd_bus_message* message);
  void on_added(sd_bus_message*) { commit(); }
  void on_committed(sd_bus_message*) {}
  void on_state_changed(sd_bus_message* message);
  /// As it is on the network.
  [[nodiscard]] std::string published_name() const;

  asio::posix::stream_descriptor descriptor;  ///< A duplicate: Asio closes what it watches.
  asio::steady_timer timer;
  Ask ask;
  Log log;
  Bus bus;
  std::string group;    ///< Its object path; empty: nothing is published.
  bool asking = false;  ///< For a group.
  Service published;
  int alternative = 1;   ///< Above 1, the name has this number.
  std::string reported;  ///< The last line that was logged.
  bool stopped = false;
};

void Announcer::Impl::set_state(const std::string& line) {
  if (std::exchange(reported, line) != line) log(line);
}

void Announcer::Impl::tick() {
  try {
    if (bus == nullptr) {
      connect();
    } else if (!group.empty() && ask() != published) {
      withdraw();
      publish();
    } else if (group.empty() && !asking) {
      look_for_avahi();  // it is not there yet, or an error took the service back
    }
  } catch (const std::exception& e) {
    set_state(std::string("the service is not announced: ") + e.what());
  }
  if (bus != nullptr) pump();
  timer.expires_after(kInterval);
  timer.async_wait([weak = weak_from_this()](const error_code& error) {
    const auto self = weak.lock();
    if (!error && self != nullptr && !self->stopped) self->tick();
  });
}

void Announcer::Impl::connect() {
  try {
    sd_bus* opened = nullptr;
    check(sd_bus_open_system(&opened));
    bus.reset(opened);
    const int copy = ::fcntl(sd_bus_get_fd(opened), F_DUPFD_CLOEXEC, 0);
    if (copy < 0) check(-errno);
    descriptor.assign(copy);
    check(sd_bus_add_match_async(
        opened, nullptr,
        "type='signal',sender='org.freedesktop.DBus',member='NameOwnerChanged',"
        "arg0='org.freedesktop.Avahi'",
        on<&Impl::on_owner_changed>, nullptr, this));
    check(sd_bus_match_signal_async(opened, nullptr, kAvahi, nullptr, kGroup, "StateChanged",
                                    on<&Impl::on_state_changed>, nullptr, this));
    look_for_avahi();
  } catch (const std::exception& e) {
    lose(e.what());
  }
}

void Announcer::Impl::lose(const std::string& reason) {
  set_state("the service is not announced: no system bus (" + reason + ")");
  error_code ignored;
  descriptor.close(ignored);
  group.clear();
  asking = false;
  bus.reset();
}

void Announcer::Impl::pump() {
  int result = 0;
  while ((result = sd_bus_process(bus.get(), nullptr)) > 0) {
  }
  if (result < 0) return lose(std::strerror(-result));
  const int events = sd_bus_get_events(bus.get());
  error_code ignored;
  descriptor.cancel(ignored);
  wait(asio::posix::stream_descriptor::wait_read);
  if (events > 0 && (events & POLLOUT) != 0) wait(asio::posix::stream_descriptor::wait_write);
}

void Announcer::Impl::wait(asio::posix::stream_descriptor::wait_type what) {
  descriptor.async_wait(what, [weak = weak_from_this()](const error_code& error) {
    const auto self = weak.lock();
    if (!error && self != nullptr && self->bus != nullptr) self->pump();
  });
}

/// It is asked for, and not only called: a call would make the bus start it.
void Announcer::Impl::look_for_avahi() {
  check(sd_bus_call_method_async(bus.get(), nullptr, kBus, "/org/freedesktop/DBus", kBus,
                                 "NameHasOwner", on<&Impl::on_has_owner>, this, "s", kAvahi));
}

void Announcer::Impl::on_has_owner(sd_bus_message* message) {
  int owned = 0;
  check(sd_bus_message_read(message, "b", &owned));
  if (owned != 0) return publish();
  set_state(
      "the service is not announced until avahi-daemon runs (apt-get install avahi-daemon, or "
      "net.announce = false)");
}

void Announcer::Impl::on_owner_changed(sd_bus_message* message) {
  const char* name = nullptr;
  const char* before = nullptr;
  const char* now = nullptr;
  check(sd_bus_message_read(message, "sss", &name, &before, &now));
  group.clear();  // went with its owner
  asking = false;
  if (*now != '\0') publish();
}

void Announcer::Impl::publish() {
  if (asking) return;
  check(sd_bus_call_method_async(bus.get(), nullptr, kAvahi, "/", kServer, "EntryGroupNew",
                                 on<&Impl::on_group>, this, ""));
  asking = true;
}

void Announcer::Impl::on_group(sd_bus_message* message) {
  const char* path = nullptr;
  check(sd_bus_message_read(message, "o", &path));
  asking = false;
  add_service(path);
}

std::string Announcer::Impl::published_name() const {
  const std::string number = alternative > 1 ? fmt::format(" #{}", alternative) : "";
  return base::first_bytes(published.name, kMaxName - number.size()) + number;
}

void Announcer::Impl::add_service(const char* path) {
  group = path;
  published = ask();
  const std::string name = published_name();
  sd_bus_message* made = nullptr;
  check(sd_bus_message_new_method_call(bus.get(), &made, kAvahi, path, kGroup, "AddService"));
  const Message message(made);
  // Interface, protocol, flags. Name, type. Domain and host, both empty: avahi's own.
  check(sd_bus_message_append(made, "iiussssq", published.interface, published.protocol, 0U,
                              name.c_str(), wire::kServiceType, "", "", published.port));
  check(sd_bus_message_open_container(made, 'a', "ay"));
  for (const auto& one : published.txt) {
    check(sd_bus_message_append_array(made, 'y', one.data(), one.size()));
  }
  check(sd_bus_message_close_container(made));
  check(sd_bus_call_async(bus.get(), nullptr, made, on<&Impl::on_added>, this, 0));
}

void Announcer::Impl::commit() {
  check(sd_bus_call_method_async(bus.get(), nullptr, kAvahi, group.c_str(), kGroup, "Commit",
                                 on<&Impl::on_committed>, this, ""));
}

void Announcer::Impl::withdraw() {
  asking = false;
  if (group.empty()) return;
  (void)sd_bus_call_method_async(bus.get(), nullptr, kAvahi, group.c_str(), kGroup, "Free",
                                 on<&Impl::on_committed>, this, "");
  group.clear();
}

void Announcer::Impl::on_state_changed(sd_bus_message* message) {
  if (group != sd_bus_message_get_path(message)) return;
  std::int32_t state = 0;
  const char* error = nullptr;
  check(sd_bus_message_read(message, "is", &state, &error));
  on_state(state, error);
}

void Announcer::Impl::on_state(std::int32_t state, const std::string& error) {
  if (state == kEstablished) {
    set_state(fmt::format("announced as \"{}\" ({}, port {})", published_name(), wire::kServiceType,
                          published.port));
  } else if (state == kCollision) {
    ++alternative;
    withdraw();
    publish();
  } else if (state == kFailure) {
    withdraw();
    set_state("the service is not announced: " + error);
  }
}

Announcer::Announcer(asio::io_context& io, Ask ask, Log log)
    : impl_(std::make_shared<Impl>(io, std::move(ask), std::move(log))) {
  impl_->tick();
}

Announcer::~Announcer() { stop(); }

void Announcer::stop() {
  if (std::exchange(impl_->stopped, true)) return;
  impl_->timer.cancel();
  error_code ignored;
  impl_->descriptor.close(ignored);
  // Avahi takes back what a client that left the bus had published.
  impl_->bus.reset();
}

}  // namespace dtact::announce
