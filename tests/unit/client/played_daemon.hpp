#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "clients/cpp/options.hpp"
#include "hal/base/unique_fd.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::client::test {

/// Longer than any message takes.
inline constexpr std::chrono::seconds kLong{60};

inline std::string framed(const v1::ServerMessage& message) {
  const auto length = wire::encode_length(message.ByteSizeLong());
  std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
  message.AppendToString(&bytes);
  return bytes;
}

/// The daemon's end of one connection. Throws std::runtime_error when the other end is gone, or
/// silent for kLong.
class Peer {
 public:
  Peer(int listening, SSL_CTX* tls) : fd_(::accept(listening, nullptr, nullptr)) {
    if (!fd_) throw std::runtime_error("nobody came");
    const timeval patience{kLong.count(), 0};
    ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (tls == nullptr) return;
    ssl_.reset(::SSL_new(tls));
    ::SSL_set_fd(ssl_.get(), fd_.get());
    if (::SSL_accept(ssl_.get()) != 1) throw std::runtime_error("no handshake");
  }

  /// The next message.
  v1::ClientMessage request() {
    while (decoder_.feed(unread_) != wire::MessageDecoder::Result::message) {
      const auto size = ssl_ ? ::SSL_read(ssl_.get(), buffer_.data(), kSize)
                             : ::recv(fd_.get(), buffer_.data(), buffer_.size(), 0);
      if (size <= 0) throw std::runtime_error("the client is gone");
      unread_ = {buffer_.data(), static_cast<std::size_t>(size)};
    }
    v1::ClientMessage message;
    if (!message.ParseFromString(decoder_.message())) throw std::runtime_error("no message");
    return message;
  }
  void send(const v1::ServerMessage& message) { send_bytes(framed(message)); }
  void send_bytes(std::string_view bytes) {
    const auto sent = ssl_ ? ::SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size()))
                           : ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) throw std::runtime_error("the client is gone");
  }
  void frame(std::uint64_t sequence) {
    v1::ServerMessage message;
    message.mutable_frame()->set_sequence(sequence);
    send(message);
  }
  /// Answers the next request with `reply` and returns the request.
  v1::ClientMessage answer(v1::Reply reply) {
    v1::ClientMessage message = request();
    reply.set_id(message.id());
    v1::ServerMessage answer;
    *answer.mutable_reply() = std::move(reply);
    send(answer);
    return message;
  }
  v1::ClientMessage done() {
    v1::Reply reply;
    reply.mutable_done();
    return answer(std::move(reply));
  }
  v1::ClientMessage refuse(v1::ErrorCode code, const std::string& sentence) {
    v1::Reply reply;
    reply.mutable_error()->set_code(code);
    reply.mutable_error()->set_message(sentence);
    return answer(std::move(reply));
  }
  /// Answers Hello and returns it.
  v1::Hello greet(const std::vector<std::string>& features = {}) {
    v1::Reply reply;
    auto& hello = *reply.mutable_hello();
    hello.set_major(wire::kMajor);
    hello.set_program("dtactd 9.8.7");
    for (const auto& feature : features) hello.add_features(feature);
    return answer(std::move(reply)).hello();
  }
  /// Waits until the client has closed. Returns whether it sent nothing before.
  bool ends_silently() {
    return (ssl_ ? ::SSL_read(ssl_.get(), buffer_.data(), kSize)
                 : ::recv(fd_.get(), buffer_.data(), buffer_.size(), 0)) <= 0;
  }
  [[nodiscard]] int fd() const { return fd_.get(); }

 private:
  static constexpr int kSize = 65536;
  struct Free {
    void operator()(SSL* p) const { ::SSL_free(p); }
  };

  base::UniqueFd fd_;
  std::unique_ptr<SSL, Free> ssl_;
  wire::MessageDecoder decoder_;
  std::array<char, kSize> buffer_{};
  std::string_view unread_;
};

/// A socket that listens on loopback, on a port of the system's choice unless one is given.
inline base::UniqueFd listen_on(std::uint16_t port = 0, in_addr_t host = INADDR_LOOPBACK) {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int reuse = 1;
  ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(host);
  if (::bind(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(fd.get(), 8) != 0) {
    throw std::runtime_error("cannot listen");
  }
  return fd;
}

inline base::UniqueFd listen_on(const std::filesystem::path& file) {
  base::UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  file.string().copy(address.sun_path, sizeof address.sun_path - 1);
  if (::bind(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(fd.get(), 8) != 0) {
    throw std::runtime_error("cannot listen on " + file.string());
  }
  return fd;
}

/// A daemon that a test plays: one play for each connection, in turn. A play ends when its
/// connection ends.
class PlayedDaemon {
 public:
  using Play = std::function<void(Peer&)>;

  explicit PlayedDaemon(std::vector<Play> plays, base::UniqueFd listening = listen_on(),
                        SSL_CTX* tls = nullptr)
      : listening_(std::move(listening)) {
    sockaddr_in address{};
    socklen_t size = sizeof address;
    ::getsockname(listening_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    const timeval patience{kLong.count(), 0};
    ::setsockopt(listening_.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    options.port = ntohs(address.sin_port);
    options.timeout = kLong;
    options.program = "test";
    thread_ = std::thread([this, tls, plays = std::move(plays)] {
      // OpenSSL raises SIGPIPE for a closed client. The client under test must not need this.
      sigset_t broken_pipe;
      ::sigemptyset(&broken_pipe);
      ::sigaddset(&broken_pipe, SIGPIPE);
      ::pthread_sigmask(SIG_BLOCK, &broken_pipe, nullptr);
      for (const Play& play : plays) {
        try {
          Peer peer(listening_.get(), tls);
          play(peer);
        } catch (const std::runtime_error&) {  // NOLINT(bugprone-empty-catch)
          // The client disconnected during the play.
        }
      }
    });
  }
  ~PlayedDaemon() { finish(); }
  PlayedDaemon(const PlayedDaemon&) = delete;
  PlayedDaemon& operator=(const PlayedDaemon&) = delete;

  /// Waits until all plays are over and the connections closed.
  void finish() {
    if (thread_.joinable()) thread_.join();
  }

  Options options;  ///< How to reach the daemon.

 private:
  base::UniqueFd listening_;
  std::thread thread_;
};

}  // namespace dtact::client::test
