#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "clients/cpp/export.hpp"
#include "proto/defaults.hpp"

namespace dtact::client {

/// How the daemon proves its identity over TCP, with TLS 1.3. At least one of the two is required;
/// if both are set, both must hold.
struct Tls {
  /// SHA-256 of its certificate (DER): 64 hexadecimal digits in either case, with or without
  /// colons. `dtactctl cert --show` prints it on the daemon's machine.
  std::string fingerprint;
  /// PEM. The certificate has to be signed by one of these and to contain the host's name.
  std::filesystem::path ca_file;
};

/// Back-off between attempts to restore a lost connection. Each wait is twice as long as the one
/// before, less a random part of up to a half. So the clients of a daemon do not all reconnect at
/// once.
struct Reconnect {
  std::chrono::milliseconds min{100};
  std::chrono::milliseconds max{5000};
};

struct Options {
  /// "gripper", "gripper:7377", "192.0.2.7", "[::1]:7377" or "unix:/run/dtactd/dtactd.sock".
  std::string host = wire::kDefaultAddress;
  std::uint16_t port = wire::kDefaultPort;   ///< Where `host` names none.
  std::string program = "dtact C++ client";  ///< Shown by dtactctl status; at most 64 bytes.
  /// For the connection and each request. Large requests have longer, for slow networks.
  std::chrono::milliseconds timeout{5000};
  /// The token, if the daemon requires one: at most 256 bytes, see read_token(). Sent only over
  /// TLS, on this machine, or if `insecure` is set.
  std::string token{};
  std::optional<Tls> tls{};  ///< Unset: plain TCP. Socket files need none and use none.
  /// Sends the token over plain TCP to other machines too, where eavesdroppers can read it.
  bool insecure = false;
  /// Unset: a lost connection is an error and makes the client unusable.
  std::optional<Reconnect> reconnect{};
  /// Frames kept while a request waits for its answer (0 counts as 1); the oldest yield.
  std::size_t kept_frames = 4;
};

/// Returns the first line of a file. Throws Error if other users may read the file, or if the line
/// is unreadable, empty, contains blanks or exceeds 256 bytes.
DTACT_EXPORT [[nodiscard]] std::string read_token(const std::filesystem::path& file);

}  // namespace dtact::client
