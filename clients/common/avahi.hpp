#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clients/common/daemon_option.hpp"
#include "clients/common/reports.pb.h"

namespace dtact::cli {

/// Fills what the strings of a service's TXT record say ("key=value"); unknown keys are passed
/// over.
void read_txt(const std::vector<std::string>& txt, FoundDaemon& to);

/// Every dtactd that this machine's avahi-daemon knows, one for each address, sorted by name. Ends
/// when Avahi reports all known ones and has looked up their addresses, or at the time limit, which
/// those look-ups may exceed by a second. Returns what is known by then when `stop` is requested.
/// Throws Failure with a sentence when no avahi-daemon runs.
[[nodiscard]] std::vector<FoundDaemon> browse(std::chrono::milliseconds timeout,
                                              const std::stop_token& stop = {});

inline constexpr const char* kNoneAnnounced =
    "no dtactd announces itself: it does where it listens beyond its own machine (net.address, "
    "net.announce) and avahi-daemon runs beside it";

/// Daemons that announce themselves, for programs that serve several: each once, under a name that
/// can be part of addresses and topics. Those that the user named are left out.
class Finder {
 public:
  struct Found {
    /// MACHINE_NAME, or NAME alone where that begins with the machine's.
    NamedDaemon daemon;
    /// A sentence where the daemon asks for TLS or a token and this program was given none.
    std::string refused;
  };

  /// `common` is what each is connected to with, besides its address. Whether one is of `named`
  /// its name or its instance tells; for the latter those are connected to when new ones appear.
  /// Of any number in a network it finds the first `max_found`.
  explicit Finder(client::Options common, std::vector<NamedDaemon> named = {},
                  std::size_t max_found = kMaxFound);

  /// Browses; returns those that are new since the last call and, under the same name, those that
  /// have left the address that they were found at. Throws as browse().
  [[nodiscard]] std::vector<Found> look(std::chrono::milliseconds timeout,
                                        const std::stop_token& stop = {});
  /// The same of `all`.
  [[nodiscard]] std::vector<Found> add(const std::vector<FoundDaemon>& all);

  static constexpr std::size_t kMaxFound = 1000;
  /// For programs that stay connected to each, on a thread: their services have 256 threads
  /// (TasksMax=), of which named daemons and subscriptions of viewers take some.
  static constexpr std::size_t kMaxConnected = 200;

 private:
  using Place = std::pair<std::string, std::uint32_t>;  ///< Host and port.
  /// What a daemon is called, and its address. Without a name it is of no use.
  struct Known {
    std::string name;
    std::string address;
  };

  [[nodiscard]] Found make(const std::string& name, const FoundDaemon& one) const;

  client::Options common_;
  std::vector<NamedDaemon> named_;
  std::size_t max_found_;
  std::map<Place, Known> known_;
  std::set<std::string> names_;  ///< Also those of `named_`.
};

/// Calls `found` for each daemon as it appears or has another address (see Finder; at most
/// kMaxConnected), and `log` with what goes wrong, on a thread that looks every few seconds until
/// the result is destroyed.
[[nodiscard]] std::jthread watch_network(const client::Options& common,
                                         std::vector<NamedDaemon> named,
                                         std::function<void(Finder::Found)> found,
                                         std::function<void(const std::string&)> log);

}  // namespace dtact::cli
