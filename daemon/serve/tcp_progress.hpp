#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace dtact::net {

/// What the kernel knows of a connection (TCP_INFO, tcp(7)).
struct TcpProgress {
  bool outstanding = false;                ///< Something is unsent or unacknowledged.
  std::uint64_t acked_bytes = 0;           ///< Since the connection began.
  std::chrono::milliseconds since_ack{0};  ///< Since the peer's last acknowledgement.
};

/// Empty when `socket` is no TCP connection.
[[nodiscard]] std::optional<TcpProgress> tcp_progress(int socket);

}  // namespace dtact::net
