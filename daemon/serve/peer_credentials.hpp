#pragma once

#include <sys/types.h>

#include <string>

namespace dtact::net {

/// Who connected to a Unix socket, by the kernel's word.
struct PeerCredentials {
  uid_t uid = static_cast<uid_t>(-1);
  std::string text = "unknown";  ///< "pid 811 (uid 1000)".
  /// root, this process's own user, or a user in this process's group.
  bool trusted = false;
};

[[nodiscard]] PeerCredentials peer_credentials(int socket);

}  // namespace dtact::net
