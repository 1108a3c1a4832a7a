#include "daemon/serve/peer_credentials.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <span>

namespace dtact::net {
namespace {

/// Whether the peer has `group` beside its own one (SO_PEERGROUPS, unix(7)).
bool has_group(int socket, gid_t group) {
  std::array<gid_t, 1024> groups{};
  socklen_t size = sizeof groups;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &size) != 0) return false;
  const auto mine = std::span(groups).first(size / sizeof(gid_t));
  return std::find(mine.begin(), mine.end(), group) != mine.end();
}

}  // namespace

PeerCredentials peer_credentials(int socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return {};
  return {peer.uid, fmt::format("pid {} (uid {})", peer.pid, peer.uid),
          peer.uid == 0 || peer.uid == ::geteuid() || peer.gid == ::getegid() ||
              has_group(socket, ::getegid())};
}

}  // namespace dtact::net
