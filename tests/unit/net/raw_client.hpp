#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "hal/base/unique_fd.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::net::test {

/// A connection from another address of this machine than 127.0.0.1, all of which reach it.
[[nodiscard]] inline base::UniqueFd connected_from(const char* from, std::uint16_t port) {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  ::inet_pton(AF_INET, from, &address.sin_addr);
  const auto* generic = reinterpret_cast<const sockaddr*>(&address);
  if (::bind(fd.get(), generic, sizeof address) != 0) throw std::runtime_error("cannot bind");
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  if (::connect(fd.get(), generic, sizeof address) != 0) throw std::runtime_error("cannot connect");
  return fd;
}

[[nodiscard]] inline sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.native().copy(static_cast<char*>(address.sun_path), sizeof address.sun_path - 1);
  return address;
}

/// A connection to a Unix socket.
[[nodiscard]] inline base::UniqueFd connected(const std::filesystem::path& path) {
  base::UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const sockaddr_un address = address_of(path);
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error("cannot connect to " + path.string());
  }
  return fd;
}

/// A client that sends and reads exactly what a test says, right or wrong.
class RawClient {
 public:
  /// `receive_buffer`: size of the kernel's receive buffer in bytes; 0 = its default.
  explicit RawClient(std::uint16_t port, int receive_buffer = 0)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (receive_buffer > 0) {
      ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot connect");
    }
  }
  /// A client on a connected socket.
  explicit RawClient(base::UniqueFd connected) : fd_(std::move(connected)) {}

  void send_bytes(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (n <= 0) return;  // Ended by the server: the test sees it when it reads.
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
  }
  void send(const v1::ClientMessage& message) {
    const auto length = wire::encode_length(message.ByteSizeLong());
    std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&bytes);
    send_bytes(bytes);
  }

  [[nodiscard]] int descriptor() const noexcept { return fd_.get(); }
  /// The next message, or nothing at the end of the connection. Throws after a minute of silence.
  std::optional<v1::ServerMessage> receive() {
    while (decoder_.feed(unread_) != wire::MessageDecoder::Result::message) {
      pollfd readable{fd_.get(), POLLIN, 0};
      const int ready = ::poll(&readable, 1, 60'000);
      if (ready < 0 && errno == EINTR) continue;  // libFuzzer's alarm
      if (ready <= 0) throw std::runtime_error("silence");
      const ssize_t n = ::recv(fd_.get(), buffer_, sizeof buffer_, 0);
      if (n <= 0) return std::nullopt;
      unread_ = {buffer_, static_cast<std::size_t>(n)};
    }
    v1::ServerMessage message;
    if (!message.ParseFromString(decoder_.message())) throw std::runtime_error("no ServerMessage");
    return message;
  }
  /// The next reply; skips frames and events before it.
  v1::Reply reply() {
    for (;;) {
      auto message = receive();
      if (!message.has_value()) throw std::runtime_error("ended");
      if (message->has_reply()) return message->reply();
    }
  }
  v1::Frame frame() {
    for (;;) {
      auto message = receive();
      if (!message.has_value()) throw std::runtime_error("ended");
      if (message->has_frame()) return message->frame();
    }
  }
  v1::Event event() {
    for (;;) {
      auto message = receive();
      if (!message.has_value()) throw std::runtime_error("ended");
      if (message->has_event()) return message->event();
    }
  }
  /// Whether the connection ends, after any messages.
  bool ends() {
    while (receive().has_value()) {
    }
    return true;
  }

  /// Whether the other side closes completely, so that data sent to it is reset. Waits 20 s.
  bool is_dropped() {
    for (int i = 0; i < 400; ++i) {
      if (::send(fd_.get(), "x", 1, MSG_NOSIGNAL) < 0) return true;
      ::poll(nullptr, 0, 50);
    }
    return false;
  }

  v1::Reply request(v1::ClientMessage message) {
    message.set_id(next_id_++);
    send(message);
    return reply();
  }
  void hello(const std::string& token = {}) {
    if (!say_hello(token).has_hello()) throw std::runtime_error("no hello");
  }
  v1::Reply say_hello(const std::string& token = {}) {
    v1::ClientMessage message;
    message.mutable_hello()->set_major(1);
    message.mutable_hello()->set_program("raw");
    message.mutable_hello()->set_token(token);
    return request(message);
  }
  void subscribe(v1::DepthEncoding depth, v1::LumaEncoding luma = v1::LUMA_NONE,
                 std::uint32_t every = 1, bool summary = false) {
    v1::ClientMessage message;
    message.mutable_subscribe()->set_depth(depth);
    message.mutable_subscribe()->set_luma(luma);
    message.mutable_subscribe()->set_every(every);
    message.mutable_subscribe()->set_summary(summary);
    if (!request(message).has_done()) throw std::runtime_error("not subscribed");
  }
  /// Sends nothing more; the other side sees the end after all data.
  void finish() { ::shutdown(fd_.get(), SHUT_WR); }
  /// Closes without an answer: the other side gets a reset.
  void die() {
    const linger now{1, 0};
    ::setsockopt(fd_.get(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
    fd_.reset();
  }

 private:
  base::UniqueFd fd_;
  std::uint64_t next_id_ = 1;
  wire::MessageDecoder decoder_;
  char buffer_[65536];
  std::string_view unread_;
};

}  // namespace dtact::net::test
