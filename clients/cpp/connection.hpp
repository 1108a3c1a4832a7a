#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "clients/cpp/channel.hpp"
#include "clients/cpp/options.hpp"
#include "proto/framing.hpp"

namespace dtact::client {

/// A connection that carries messages, with deadlines. Not part of the library's interface.
class Connection {
 public:
  /// To the daemon that `options` names, verified where they ask for it. Throws Error,
  /// ConnectionError or IdentityError naming the fix.
  Connection(const Options& options, const Limit& limit);

  /// One message with its length. Throws ConnectionError, also when the limit comes first: half of
  /// a message may be on its way then.
  void write(std::string_view message, const Limit& limit);
  /// The next message, valid until the next call; null when the limit came first. Throws
  /// ConnectionError, ProtocolError.
  [[nodiscard]] const std::string* read(const Limit& limit);

  /// The other end is on this machine.
  [[nodiscard]] bool local() const noexcept { return socket_.local; }
  /// The other end is verified, or nothing that is sent leaves this machine.
  [[nodiscard]] bool confidential() const noexcept { return encrypted_ || socket_.loopback; }
  /// "gripper port 7377", for sentences.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] int native_handle() const noexcept { return socket_.fd.get(); }

 private:
  Connection(const Options& options, const Address& address, const Limit& limit);
  void send(std::string_view bytes, const Limit& limit);

  std::string name_;
  Socket socket_;
  bool encrypted_;
  bool heard_ = false;  ///< Anything at all.
  std::unique_ptr<Channel> channel_;
  wire::MessageDecoder decoder_;
  std::array<char, 65536> buffer_{};
  std::string_view unread_;  ///< Part of buffer_.
};

}  // namespace dtact::client
