#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "proto/defaults.hpp"

namespace dtact::net {

enum class LogLevel : std::uint8_t { info, warning };

/// What the network part wants said. Called on the network thread only; must not throw.
using Log = std::function<void(LogLevel, const std::string&)>;

/// Settings of the network part.
struct NetConfig {
  /// IPv4 or IPv6 address to listen on. "0.0.0.0" or "::" (which takes IPv4 too) for every
  /// interface. It may come later than the daemon, as by DHCP. There is no authentication: whoever
  /// can connect can command.
  std::string address = wire::kDefaultAddress;
  std::uint16_t port = wire::kDefaultPort;  ///< 0: any free one, see Server::port().
  std::size_t max_clients = 32;             ///< More are refused with a sentence.
  std::string frame_id = "dtact_surface";   ///< Name of the surface frame in every message.
  std::string name;                         ///< The daemon's own, in the handshake and status.
  std::string program = "dtactd";           ///< "dtactd 0.1.0": in the handshake.
  std::string version;                      ///< "0.1.0": in status.
  std::chrono::milliseconds hello_timeout{5000};  ///< A client silent for so long is let go.
  /// A peer whose machine has not answered for so long is dead: a pulled cable. One that answers and
  /// only does not read is not.
  std::chrono::milliseconds dead_after{30000};
  /// SCHED_FIFO priority of the thread that runs the network part, below the capture thread's; 0 =
  /// normal scheduling. Whoever owns the thread sets it, …
  int fifo_priority = 20;
  std::string realtime_refused;  ///< … and says here why it was refused; in status.
  Log log = [](LogLevel, const std::string&) {};
};

}  // namespace dtact::net
