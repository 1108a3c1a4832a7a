#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "daemon/serve/rights.hpp"
#include "proto/defaults.hpp"
#include "proto/features.hpp"

namespace dtact::net {

enum class LogLevel : std::uint8_t { debug, info, warning };

/// What a line is about. Each has a rate limit of its own (limited()).
enum class LogSubject : std::uint8_t {
  general,
  unauthenticated,  ///< A client that is not authenticated.
  change,           ///< A command that changes something.
  denied            ///< One that the client's rights do not allow.
};
inline constexpr std::size_t kLogSubjects = 4;

/// A line for the log.
struct LogLine {
  LogLevel level = LogLevel::info;
  std::string text;
  std::string client = {};  ///< The client concerned, as Peer.address; may be empty.
  LogSubject subject = LogSubject::general;
  std::string token = {};  ///< The name of the client's token; may be empty.
};
/// Called on the network thread only; must not throw.
using Log = std::function<void(const LogLine&)>;

/// What a user writes to change a setting, for messages: a key of the configuration file, or an
/// option.
struct SettingNames {
  const char* address = "net.address = ";  ///< Before its value.
  const char* tls_certificate = "net.tls_certificate";
  const char* tls_key = "net.tls_key";
  const char* tokens = "net.tokens";
  const char* insecure = "net.listen_insecure = true";
};

/// Settings of the network part.
struct NetConfig {
  /// IPv4 or IPv6 address to listen on. "0.0.0.0" or "::" (which takes IPv4 too) for every
  /// interface; empty for no TCP. It may come later than the daemon, as by DHCP.
  std::string address = wire::kDefaultAddress;
  std::uint16_t port = wire::kDefaultPort;  ///< 0: any free one, see Server::port().
  /// An address beyond this machine may do without TLS or a token, see check_security().
  bool insecure = false;
  std::filesystem::path unix_socket;  ///< For clients on this machine; empty: none.
  /// PEM files; with them TCP speaks TLS only. Both or none.
  std::filesystem::path tls_certificate;
  std::filesystem::path tls_key;
  /// See Tokens. With it every client needs a token, but for Peer.trusted; without it none does.
  std::filesystem::path token_file;
  Rights anonymous_rights = Rights::calibrate;  ///< Of every client where there is no token file.
  /// More are refused with a sentence; see Admission::kReserved.
  std::size_t max_clients = 32;
  std::size_t max_clients_per_address = 16;  ///< The same for each Peer.host.
  /// Rate limit of one client, and its burst. A request counts once for each 64 kB of it.
  int max_requests_per_s = 500;
  std::string frame_id = "dtact_surface";  ///< Name of the surface frame in every message.
  std::string name;                        ///< The daemon's own, in the handshake and status.
  std::string instance;                    ///< HelloReply.instance.
  std::string program = "dtactd";          ///< "dtactd 0.1.0": in the handshake.
  std::string version;                     ///< "0.1.0": in status.
  /// HelloReply.features: of what lives as long as the program.
  std::span<const char* const> features = wire::kFeatures;
  std::chrono::milliseconds hello_timeout{5000};  ///< closes a client without Hello by then
  /// A peer whose machine has not answered for this long is dead (a pulled cable). One that answers
  /// but does not read is not.
  std::chrono::milliseconds peer_timeout{30000};
  /// SCHED_FIFO priority of the thread that runs the network part, below the capture thread's; 0 =
  /// normal scheduling. Set by the owner of the thread, …
  int fifo_priority = 20;
  std::string realtime_refused;  ///< … and says here why it was refused; in status.
  std::filesystem::path thermal_folder = "/sys/class/thermal";  ///< See base::temperatures().
  SettingNames names;
  Log log = [](const LogLine&) {};
};

}  // namespace dtact::net
