#pragma once

#include <cstdint>
#include <string>

namespace dtact::client {

/// Where a daemon listens: a socket file, or a host and a port. Not part of the library's
/// interface.
struct Address {
  std::string unix_path;  ///< Set: all that counts.
  std::string host;       ///< Name or address.
  std::uint16_t port = 0;

  /// "gripper port 7377", "unix:/run/dtactd/dtactd.sock": for sentences.
  [[nodiscard]] std::string name() const;
};

/// Reads "gripper", "gripper:7377", "192.0.2.7", "fe80::1%eth0", "[::1]:7377" and "unix:/PATH";
/// `port` is the default where the text has none. Throws Error naming the forms.
[[nodiscard]] Address parse_address(const std::string& text, std::uint16_t port);

}  // namespace dtact::client
