#include "clients/cpp/channel.hpp"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <span>
#include <system_error>
#include <vector>

#include "clients/cpp/errors.hpp"

namespace dtact::client {
namespace {

std::string text_of(int error) { return std::generic_category().message(error); }

[[noreturn]] void refuse(int error, const Address& address) {
  const std::string name = address.name();
  if (error == ECONNREFUSED || (error == ENOENT && !address.unix_path.empty())) {
    throw ConnectionError(
        fmt::format("nothing listens on {}: is dtactd running (systemctl status dtactd), and is "
                    "this its address and port?",
                    name));
  }
  if (error == ETIMEDOUT) {
    throw ConnectionError(
        fmt::format("{} does not answer: check the address, the network and the firewall", name));
  }
  if (error == EACCES && !address.unix_path.empty()) {
    throw ConnectionError(
        fmt::format("this user may not use {}: join the group that owns it (ls -l {})", name,
                    address.unix_path));
  }
  throw ConnectionError(fmt::format("cannot connect to {}: {}", name, text_of(error)));
}

/// Waits for the descriptors, the last of which ends the wait. False: it did, or `end` came first.
bool poll_until(std::span<pollfd> descriptors, std::chrono::steady_clock::time_point end) {
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    const auto timeout = std::clamp<std::chrono::milliseconds::rep>(left.count(), 0, 1'000'000);
    const int ready = ::poll(descriptors.data(), descriptors.size(), static_cast<int>(timeout));
    if (ready > 0) {
      return std::ranges::any_of(descriptors.first(descriptors.size() - 1),
                                 [](const pollfd& one) { return one.revents != 0; });
    }
    if (ready == 0 && left.count() <= 1'000'000) return false;
    if (ready < 0 && errno != EINTR) throw ConnectionError("cannot wait: " + text_of(errno));
  }
}

/// What a connection attempt that has ended came to: 0 or errno.
int result_of(int fd) {
  int result = 0;
  socklen_t length = sizeof result;
  ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &result, &length);
  return result;
}

/// Returns 0 or errno.
int connect_within(int fd, const sockaddr* to, socklen_t size, const Limit& limit) {
  if (::connect(fd, to, size) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!wait(fd, POLLOUT, limit)) return ETIMEDOUT;
  return result_of(fd);
}

base::UniqueFd open_socket(int family) {
  return base::UniqueFd(::socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

Socket connect_unix(const Address& address, const Limit& limit) {
  Socket socket{open_socket(AF_UNIX), true, true};
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  address.unix_path.copy(to.sun_path, sizeof to.sun_path - 1);
  const int error = socket.fd
                        ? connect_within(socket.fd.get(), reinterpret_cast<const sockaddr*>(&to),
                                         sizeof to, limit)
                        : errno;
  if (error != 0) refuse(error, address);
  return socket;
}

bool is_loopback(const sockaddr_storage& address) {
  const auto is_127 = [](const void* bytes) {
    return *static_cast<const std::uint8_t*>(bytes) == 127;
  };
  if (address.ss_family == AF_INET) {
    return is_127(&reinterpret_cast<const sockaddr_in&>(address).sin_addr);
  }
  const in6_addr& six = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
  return IN6_IS_ADDR_LOOPBACK(&six) || (IN6_IS_ADDR_V4MAPPED(&six) && is_127(&six.s6_addr[12]));
}

bool same_host(const sockaddr_storage& a, const sockaddr_storage& b) {
  if (a.ss_family != b.ss_family) return false;
  if (a.ss_family == AF_INET) {
    return reinterpret_cast<const sockaddr_in&>(a).sin_addr.s_addr ==
           reinterpret_cast<const sockaddr_in&>(b).sin_addr.s_addr;
  }
  return IN6_ARE_ADDR_EQUAL(&reinterpret_cast<const sockaddr_in6&>(a).sin6_addr,
                            &reinterpret_cast<const sockaddr_in6&>(b).sin6_addr);
}

/// What the kernel keeps of a stream for one that reads late. Left to itself it keeps up to 6 MiB
/// and more (tcp_rmem in tcp(7)): to one slower than the frames every frame would come that many
/// frames late, and so would answers. Enough for 30 MB/s over a network of 8 ms.
constexpr int kUnread = 256 * 1024;

/// Without any of these a connection works all the same, so what they return does not matter.
void tune(int fd) {
  const auto set = [fd](int level, int option, int value) {
    ::setsockopt(fd, level, option, &value, sizeof value);
  };
  set(IPPROTO_TCP, TCP_NODELAY, 1);
  set(SOL_SOCKET, SO_RCVBUF, kUnread);
  // A peer that is gone without a word: asked after 5 s of silence, given up after 2 s more each
  // time; and 10 s after data that nothing confirms (tcp(7)).
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 5);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 2);
  set(IPPROTO_TCP, TCP_KEEPCNT, 3);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, 10'000);
}

/// How long an address is tried alone before the next one is tried beside it (RFC 8305, section 5).
constexpr std::chrono::milliseconds kAttemptDelay{250};

/// The first of the addresses that a connection is made to. Null when none is: `error` is errno
/// then. An address that stays silent does not keep the next one from being tried.
base::UniqueFd connect_first(const addrinfo* next, const Limit& limit, int& error) {
  using Clock = std::chrono::steady_clock;
  std::vector<base::UniqueFd> attempts;
  auto next_due = Clock::now();
  while (next != nullptr || !attempts.empty()) {
    if (next != nullptr && (attempts.empty() || Clock::now() >= next_due)) {
      base::UniqueFd fd = open_socket(next->ai_family);
      if (fd && ::connect(fd.get(), next->ai_addr, next->ai_addrlen) == 0) return fd;
      if (fd && errno == EINPROGRESS) {
        attempts.push_back(std::move(fd));
      } else {
        error = errno;
      }
      next = next->ai_next;
      next_due = Clock::now() + kAttemptDelay;
      continue;
    }
    std::vector<pollfd> waiting;
    waiting.reserve(attempts.size() + 1);
    for (const base::UniqueFd& fd : attempts) waiting.push_back({fd.get(), POLLOUT, 0});
    waiting.push_back({limit.wake, POLLIN, 0});
    const auto until = next == nullptr ? limit.end : std::min(limit.end, next_due);
    if (!poll_until(waiting, until)) {
      const bool woken = waiting.back().revents != 0;
      if (!woken && until < limit.end) continue;
      if (error == 0) error = ETIMEDOUT;
      return {};
    }
    for (std::size_t i = attempts.size(); i-- > 0;) {
      if (waiting[i].revents == 0) continue;
      const int result = result_of(attempts[i].get());
      if (result == 0) return std::move(attempts[i]);
      error = result;
      attempts.erase(attempts.begin() + static_cast<std::ptrdiff_t>(i));
      next_due = Clock::now();
    }
  }
  return {};
}

Socket connect_tcp(const Address& address, const Limit& limit) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int missing =
      ::getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found);
  if (missing != 0) {
    throw ConnectionError(fmt::format("cannot find the host \"{}\": {}; give its address",
                                      address.host, ::gai_strerror(missing)));
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  int error = 0;
  base::UniqueFd fd = connect_first(found, limit, error);
  if (!fd) refuse(error, address);
  tune(fd.get());
  sockaddr_storage here{};
  sockaddr_storage there{};
  socklen_t here_size = sizeof here;
  socklen_t there_size = sizeof there;
  const bool known = ::getsockname(fd.get(), reinterpret_cast<sockaddr*>(&here), &here_size) == 0 &&
                     ::getpeername(fd.get(), reinterpret_cast<sockaddr*>(&there), &there_size) == 0;
  const bool loopback = known && is_loopback(there);
  return {std::move(fd), loopback, loopback || (known && same_host(here, there))};
}

template <typename Count>
Transfer moved(Count count, short direction) {
  if (count >= 0) return {static_cast<std::size_t>(count), 0, 0};
  if (errno == EAGAIN || errno == EINTR) return {0, direction, 0};
  return {0, 0, errno};
}

}  // namespace

bool wait(int fd, short events, const Limit& limit) {
  std::array<pollfd, 2> one{{{fd, events, 0}, {limit.wake, POLLIN, 0}}};
  return poll_until(one, limit.end);
}

Transfer PlainChannel::read(std::span<char> into) {
  return moved(::recv(fd_, into.data(), into.size(), 0), POLLIN);
}

Transfer PlainChannel::write(std::string_view bytes) {
  return moved(::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL), POLLOUT);
}

Socket connect_to(const Address& address, const Limit& limit) {
  return address.unix_path.empty() ? connect_tcp(address, limit) : connect_unix(address, limit);
}

}  // namespace dtact::client
