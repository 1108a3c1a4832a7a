#include "clients/common/avahi.hpp"

#include <fmt/format.h>
#include <net/if.h>
#include <systemd/sd-bus.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <condition_variable>
#include <cstring>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <tuple>

#include "clients/common/exit_codes.hpp"
#include "clients/cpp/client.hpp"
#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"

namespace dtact::cli {
namespace {

using std::chrono::steady_clock;

// Avahi's D-Bus interface: avahi-daemon/org.freedesktop.Avahi.{Server,ServiceBrowser}.xml of its
// source.
constexpr const char* kAvahi = "org.freedesktop.Avahi";
constexpr const char* kServer = "org.freedesktop.Avahi.Server";
constexpr const char* kBrowser = "org.freedesktop.Avahi.ServiceBrowser";
constexpr std::int32_t kAny = -1;  // interface or protocol
constexpr std::chrono::seconds kInstanceTimeout{2};
/// Avahi itself waits five seconds for a daemon that was switched off, and lists it for an hour.
constexpr std::chrono::seconds kResolveTimeout{1};
/// Look-ups at a time: the system bus allows 128 unanswered calls.
constexpr std::size_t kMaxResolving = 64;
/// Between two looks at a stop token.
constexpr std::chrono::milliseconds kStopCheck{100};

struct Unref {
  void operator()(sd_bus* bus) const noexcept { sd_bus_flush_close_unref(bus); }
  void operator()(sd_bus_slot* slot) const noexcept { sd_bus_slot_unref(slot); }
};
using Bus = std::unique_ptr<sd_bus, Unref>;
using Slot = std::unique_ptr<sd_bus_slot, Unref>;

class Error {
 public:
  Error() = default;
  ~Error() { sd_bus_error_free(&error_); }
  Error(const Error&) = delete;
  Error& operator=(const Error&) = delete;
  sd_bus_error* get() { return &error_; }
  [[nodiscard]] std::string text(int result) const {
    return error_.message != nullptr ? error_.message : std::strerror(-result);
  }

 private:
  sd_bus_error error_{};
};

[[noreturn]] void fail(const std::string& reason) {
  throw Failure(kFailed,
                fmt::format("this machine has no avahi-daemon to ask ({}): apt-get install "
                            "avahi-daemon, or name daemons with --host or --daemon",
                            reason));
}

/// One instance of the service, on one interface and protocol.
struct Instance {
  std::int32_t interface = kAny;
  std::int32_t protocol = kAny;
  std::string name;
  std::string domain;
};

/// Results from the browser.
struct Received {
  std::vector<Instance> instances;
  bool all = false;
};

int on_signal(sd_bus_message* message, void* user_data, sd_bus_error*) {
  auto& received = *static_cast<Received*>(user_data);
  if (sd_bus_message_is_signal(message, kBrowser, "ItemNew") > 0) {
    Instance one;
    const char* name = nullptr;
    const char* type = nullptr;
    const char* domain = nullptr;
    if (sd_bus_message_read(message, "iisss", &one.interface, &one.protocol, &name, &type,
                            &domain) >= 0) {
      one.name = name;
      one.domain = domain;
      received.instances.push_back(std::move(one));
    }
  } else if (sd_bus_message_is_signal(message, kBrowser, "AllForNow") > 0 ||
             sd_bus_message_is_signal(message, kBrowser, "Failure") > 0) {
    received.all = true;
  }
  return 0;
}

Bus open_bus() {
  sd_bus* opened = nullptr;
  if (const int result = sd_bus_open_system(&opened); result < 0) {
    fail(fmt::format("no system bus: {}", std::strerror(-result)));
  }
  return Bus(opened);
}

/// Handles what the bus sends until `done()`, a time or a stop.
template <typename Done>
void process(sd_bus* bus, steady_clock::time_point end, const std::stop_token& stop, Done done) {
  while (!done() && !stop.stop_requested()) {
    const int handled = sd_bus_process(bus, nullptr);
    if (handled > 0) continue;
    const auto left = std::min<steady_clock::duration>(end - steady_clock::now(), kStopCheck);
    if (handled < 0 || left.count() <= 0) return;
    sd_bus_wait(bus, static_cast<std::uint64_t>(
                         std::chrono::ceil<std::chrono::microseconds>(left).count()));
  }
}

std::vector<Instance> list_instances(sd_bus* bus, std::chrono::milliseconds timeout,
                                     const std::stop_token& stop) {
  Received received;
  Error error;
  // Before the browser, which reports known services at once.
  sd_bus_slot* match = nullptr;
  int result =
      sd_bus_match_signal(bus, &match, kAvahi, nullptr, kBrowser, nullptr, on_signal, &received);
  const Slot owner(match);
  if (result >= 0) {
    result = sd_bus_call_method(bus, kAvahi, "/", kServer, "ServiceBrowserNew", error.get(),
                                nullptr, "iissu", kAny, kAny, wire::kServiceType, "", 0U);
  }
  if (result < 0) fail(error.text(result));
  process(bus, steady_clock::now() + timeout, stop, [&] { return received.all; });
  return std::move(received.instances);
}

std::vector<std::string> read_strings(sd_bus_message* message) {
  std::vector<std::string> all;
  if (sd_bus_message_enter_container(message, 'a', "ay") < 0) return all;
  const void* bytes = nullptr;
  std::size_t size = 0;
  while (sd_bus_message_read_array(message, 'y', &bytes, &size) > 0) {
    all.emplace_back(static_cast<const char*>(bytes), size);
  }
  return all;
}

/// The answer of ResolveService; nothing when the daemon left meanwhile.
std::optional<FoundDaemon> read_service(sd_bus_message* answer) {
  if (sd_bus_message_is_method_error(answer, nullptr) > 0) return std::nullopt;
  std::int32_t interface = 0;
  std::int32_t protocol = 0;
  std::array<const char*, 5> texts{};  // name, type, domain, host, address
  std::uint16_t port = 0;
  if (sd_bus_message_read(answer, "iissssisq", &interface, &protocol, &texts[0], &texts[1],
                          &texts[2], &texts[3], &protocol, &texts[4], &port) < 0) {
    return std::nullopt;
  }
  FoundDaemon found;
  found.set_name(base::printable(texts[0]));
  found.set_host(base::printable(texts[3]));
  found.set_address(texts[4]);
  found.set_port(port);
  // A link-local address means something on one interface only.
  std::array<char, IF_NAMESIZE> device{};
  if (found.address().starts_with("fe80:") &&
      ::if_indextoname(static_cast<unsigned>(interface), device.data()) != nullptr) {
    found.mutable_address()->append("%").append(device.data());
  }
  read_txt(read_strings(answer), found);
  return found;
}

/// Answers from ResolveService.
struct Resolved {
  std::vector<FoundDaemon> all;
  std::size_t unanswered = 0;
};

int on_resolved(sd_bus_message* answer, void* user_data, sd_bus_error*) {
  auto& resolved = *static_cast<Resolved*>(user_data);
  --resolved.unanswered;
  if (auto found = read_service(answer)) resolved.all.push_back(*std::move(found));
  return 0;
}

/// Looks addresses up at the same time, so that daemons that were switched off do not hold up
/// others.
std::vector<FoundDaemon> resolve(sd_bus* bus, const std::vector<Instance>& instances,
                                 steady_clock::time_point end, const std::stop_token& stop) {
  (void)sd_bus_set_method_call_timeout(
      bus, static_cast<std::uint64_t>(kResolveTimeout / std::chrono::microseconds(1)));
  Resolved resolved;
  auto next = instances.begin();
  process(bus, end, stop, [&] {
    for (; next != instances.end() && resolved.unanswered < kMaxResolving; ++next) {
      if (sd_bus_call_method_async(bus, nullptr, kAvahi, "/", kServer, "ResolveService",
                                   on_resolved, &resolved, "iisssiu", next->interface,
                                   next->protocol, next->name.c_str(), wire::kServiceType,
                                   next->domain.c_str(), next->protocol, 0U) >= 0) {
        ++resolved.unanswered;
      }
    }
    return resolved.unanswered == 0;
  });
  return std::move(resolved.all);
}

/// The name of a daemon, with that of its machine unless it is named after it: other machines may
/// have daemons of the same name.
std::string name_of(const FoundDaemon& found) {
  const auto cleaned = [](const std::string& text) {
    std::string made;
    for (const char c : text) {
      const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0;
      if (plain) made += c;
      if (!plain && !made.empty() && made.back() != '_') made += '_';
    }
    while (!made.empty() && made.back() == '_') made.pop_back();
    return made;
  };
  // Avahi calls the second daemon of a name "left #2", whichever came later.
  const std::string name = cleaned(found.name().substr(0, found.name().find(" #")));
  const std::string machine = cleaned(found.host().substr(0, found.host().find('.')));
  std::string made = name.starts_with(machine) ? name : machine + "_" + name;
  if (made.empty() || std::isdigit(static_cast<unsigned char>(made.front())) != 0) {
    made.insert(0, "sensor_");
  }
  made.resize(std::min(made.size(), kMaxName - std::string_view("_65535").size()));
  while (made.back() == '_') made.pop_back();
  return made;
}

/// Of those that answer. All are asked at the same time.
std::set<std::string> instances(const std::vector<NamedDaemon>& daemons) {
  std::vector<std::future<std::string>> answers;
  answers.reserve(daemons.size());
  for (const NamedDaemon& one : daemons) {
    answers.push_back(std::async(std::launch::async, [options = one.options]() mutable {
      options.timeout = std::min<std::chrono::milliseconds>(options.timeout, kInstanceTimeout);
      return client::Client(options).server().instance();
    }));
  }
  std::set<std::string> all;
  for (auto& answer : answers) {
    try {
      all.insert(answer.get());
    } catch (const std::exception&) {
      continue;  // it announces nothing, and its own connection says why it does not answer
    }
  }
  return all;
}

}  // namespace

void read_txt(const std::vector<std::string>& txt, FoundDaemon& to) {
  for (const auto& one : txt) {
    const auto split = one.find('=');
    if (split == std::string::npos) continue;
    const std::string key = one.substr(0, split);
    std::string value = one.substr(split + 1);
    // Unlike names, these need not be UTF-8, and the network may say anything.
    std::ranges::replace_if(value, [](unsigned char c) { return c < 0x20 || c > 0x7e; }, '?');
    if (key == "version") to.set_version(value);
    if (key == "serial") to.set_serial(value);
    if (key == "instance") to.set_instance(value);
    if (key == "tls") to.set_tls(value == "1");
    if (key == "token") to.set_token(value == "1");
  }
}

std::vector<FoundDaemon> browse(std::chrono::milliseconds timeout, const std::stop_token& stop) {
  const auto end = steady_clock::now() + timeout;
  const Bus bus = open_bus();
  const std::vector<Instance> instances = list_instances(bus.get(), timeout, stop);
  std::vector<FoundDaemon> all =
      resolve(bus.get(), instances, std::max(end, steady_clock::now() + kResolveTimeout), stop);
  // On several interfaces it may be the same.
  const auto key = [](const FoundDaemon& one) {
    return std::tie(one.name(), one.address(), one.host());
  };
  const auto same = [&](const auto& a, const auto& b) {
    return key(a) == key(b) && a.port() == b.port();
  };
  std::ranges::sort(all, [&](const auto& a, const auto& b) { return key(a) < key(b); });
  all.erase(std::unique(all.begin(), all.end(), same), all.end());
  return all;
}

Finder::Finder(client::Options common, std::vector<NamedDaemon> named, std::size_t max_found)
    : common_(std::move(common)), named_(std::move(named)), max_found_(max_found) {
  for (const NamedDaemon& one : named_) names_.insert(one.name);
}

std::vector<Finder::Found> Finder::look(std::chrono::milliseconds timeout,
                                        const std::stop_token& stop) {
  return add(browse(timeout, stop));
}

std::vector<Finder::Found> Finder::add(const std::vector<FoundDaemon>& all) {
  std::vector<Found> changed;
  std::set<std::pair<Place, std::string>> announced;
  for (const FoundDaemon& one : all) announced.insert({{one.host(), one.port()}, one.address()});
  std::optional<std::set<std::string>> named;  // once they are needed
  for (const FoundDaemon& one : all) {
    const Place place{one.host(), one.port()};
    const auto known = known_.find(place);
    if (known != known_.end()) {
      // A daemon may have several addresses.
      if (announced.contains({place, known->second.address})) continue;
      known->second.address = one.address();
      if (!known->second.name.empty()) changed.push_back(make(known->second.name, one));
      continue;
    }
    // Known ones may stand behind it, at another address by now.
    if (known_.size() == max_found_) continue;
    if (!named) named = instances(named_);
    Known& fresh = known_[place];
    fresh.address = one.address();
    std::string name = name_of(one);
    if ((!one.instance().empty() && named->contains(one.instance())) ||
        std::ranges::find(named_, name, &NamedDaemon::name) != named_.end()) {
      continue;
    }
    const std::string wanted = name;
    for (std::uint32_t number = one.port(); !names_.insert(name).second; ++number) {
      name = fmt::format("{}_{}", wanted, number);
    }
    changed.push_back(make(name, one));
    if (changed.back().refused.empty()) fresh.name = name;
  }
  return changed;
}

Finder::Found Finder::make(const std::string& name, const FoundDaemon& one) const {
  Found found{{name, common_}, {}};
  found.daemon.options.host = one.address();
  found.daemon.options.port = static_cast<std::uint16_t>(one.port());
  const bool tls = one.tls() && !common_.tls;
  if (tls || (one.token() && common_.token.empty())) {
    found.refused = fmt::format("{} at {}:{} asks for {}: name it with --daemon", name, one.host(),
                                one.port(), tls ? "TLS" : "a token");
  }
  return found;
}

std::jthread watch_network(const client::Options& common, std::vector<NamedDaemon> named,
                           std::function<void(Finder::Found)> found,
                           std::function<void(const std::string&)> log) {
  return std::jthread([finder = Finder(common, std::move(named), Finder::kMaxConnected),
                       found = std::move(found),
                       log = std::move(log)](const std::stop_token& stop) mutable {
    std::mutex mutex;
    std::condition_variable_any stopped;
    std::string reported;
    while (!stop.stop_requested()) {
      try {
        for (Finder::Found& one : finder.look(std::chrono::seconds(1), stop)) found(std::move(one));
        reported.clear();
      } catch (const std::exception& e) {
        if (std::exchange(reported, e.what()) != e.what()) log(reported);
      }
      std::unique_lock lock(mutex);
      stopped.wait_for(lock, stop, std::chrono::seconds(3), [] { return false; });
    }
  });
}

}  // namespace dtact::cli
