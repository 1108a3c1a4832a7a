#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <span>
#include <string_view>

#include "clients/cpp/address.hpp"
#include "hal/base/unique_fd.hpp"

// The way of the bytes, without waiting. Not part of the library's interface.
namespace dtact::client {

/// When to stop waiting: at a moment, or as soon as the descriptor `wake` can be read.
struct Limit {
  std::chrono::steady_clock::time_point end;
  int wake = -1;
};

/// The moment in `wait` from now, and later by what a message of `bytes` takes at 1 Mbit/s: the
/// clock's last one where its count does not reach that far.
[[nodiscard]] inline std::chrono::steady_clock::time_point after(std::chrono::milliseconds wait,
                                                                 std::size_t bytes = 0) {
  using Clock = std::chrono::steady_clock;
  const auto from = Clock::now() + std::chrono::milliseconds(bytes / 125);
  // Compared as milliseconds: milliseconds::max() is more than the clock's nanoseconds can count.
  const auto most = std::chrono::floor<std::chrono::milliseconds>(Clock::time_point::max() - from);
  if (wait.count() >= most.count()) return Clock::time_point::max();
  return from + std::max(wait, std::chrono::milliseconds(0));
}

/// Waits until `fd` is ready for `events` (of poll(2)); −1 waits for the limit alone. False: the
/// limit came first.
[[nodiscard]] bool wait(int fd, short events, const Limit& limit);

/// What one read or write came to.
struct Transfer {
  std::size_t bytes = 0;
  short wait = 0;  ///< POLLIN or POLLOUT: nothing moved, wait for this and repeat.
  int error = 0;   ///< errno. With 0 here and in the others, the other end has closed.
};

/// Bytes over a connected socket that does not block, bare or encrypted.
class Channel {
 public:
  Channel() = default;
  virtual ~Channel() = default;
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  [[nodiscard]] virtual Transfer read(std::span<char> into) = 0;
  /// `bytes` are not empty.
  [[nodiscard]] virtual Transfer write(std::string_view bytes) = 0;
};

/// recv(2) and send(2), without SIGPIPE.
class PlainChannel : public Channel {
 public:
  explicit PlainChannel(int fd) : fd_(fd) {}
  [[nodiscard]] Transfer read(std::span<char> into) override;
  [[nodiscard]] Transfer write(std::string_view bytes) override;

 private:
  int fd_;
};

/// A connected socket that does not block.
struct Socket {
  base::UniqueFd fd;
  bool loopback = false;  ///< What is sent never leaves this machine: loopback or a socket file.
  bool local = false;     ///< The other end is on this machine, by whichever address.
};

/// Connects to the first address of the name that answers. A TCP peer that falls silent (a pulled
/// cable) is given up after some ten seconds, with or without data on the way. Throws
/// ConnectionError naming the fix. Looking a name up is not bounded by the limit.
[[nodiscard]] Socket connect_to(const Address& address, const Limit& limit);

}  // namespace dtact::client
