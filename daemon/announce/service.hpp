#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace dtact::announce {

/// What is said of a daemon in the network (RFC 6763).
struct Service {
  std::string name;  ///< This daemon's; at most 63 bytes are sent.
  std::uint16_t port = 0;
  int interface = -1;            ///< The kernel's index; −1 = every one.
  int protocol = -1;             ///< Avahi's: 0 = IPv4, 1 = IPv6, −1 = both.
  std::vector<std::string> txt;  ///< "key=value", as proto/README.md lists them.
  bool operator==(const Service&) const = default;
};

/// What a client wants to know before it connects.
struct Facts {
  std::string version;   ///< "0.1.0"
  std::string serial;    ///< The camera's, or empty.
  std::string instance;  ///< HelloReply.instance.
  bool tls = false;
  bool token = false;  ///< Asks for one.
};
[[nodiscard]] std::vector<std::string> txt_of(const Facts& facts);

/// Whether another machine can connect to a daemon that listens on `address` (IPv4 or
/// IPv6): false for loopback.
[[nodiscard]] bool is_reachable(const std::string& address);
/// Restricts `service` to where `address` is: the family that is served, and the one interface that
/// has it, if one has it now.
void restrict_to(const std::string& address, Service& service);

}  // namespace dtact::announce
