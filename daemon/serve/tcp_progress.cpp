#include "daemon/serve/tcp_progress.hpp"

// The kernel's header, whose tcp_info has more than the C library's. The two cannot be included
// together, and Asio includes the other.
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cstddef>

namespace dtact::net {

std::optional<TcpProgress> tcp_progress(int socket) {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  // Before Linux 4.6 it had fewer fields, and qemu-user returns four bytes.
  constexpr std::size_t kNeeded =
      offsetof(tcp_info, tcpi_notsent_bytes) + sizeof info.tcpi_notsent_bytes;
  if (size < kNeeded) return std::nullopt;
  return TcpProgress{info.tcpi_unacked > 0 || info.tcpi_notsent_bytes > 0, info.tcpi_bytes_acked,
                     std::chrono::milliseconds(info.tcpi_last_ack_recv)};
}

}  // namespace dtact::net
