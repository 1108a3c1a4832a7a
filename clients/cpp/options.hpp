#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "clients/cpp/export.hpp"
#include "proto/defaults.hpp"

namespace dtact::client {

/// How the daemon proves over TCP that it is the one meant. At least one is needed; what is given
/// has to hold. TLS 1.3.
struct Tls {
  /// SHA-256 of its certificate (DER): 64 hexadecimal digits in either case, with or without
  /// colons. `dtactctl cert --show` prints it on the daemon's machine.
  std::string fingerprint;
  /// PEM. The certificate has to be signed by one of these and to contain the host's name.
  std::filesystem::path ca_file;
};

/// How long to wait between attempts to get a lost connection back: each twice as long as the one
/// before, less a random part of up to a half, so that the clients of a daemon do not all come at
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
  std::chrono::milliseconds timeout{5000};   ///< Of the connection and of each request.
  /// What the daemon asks for, if it does: at most 256 bytes, see read_token(). Sent once the other
  /// end is known: over TLS, on this machine, or where `insecure` says so.
  std::string token{};
  std::optional<Tls> tls{};  ///< Unset: plain TCP. Socket files need none and use none.
  /// Sends the token over plain TCP to other machines too: whoever hears it there may use it.
  bool insecure = false;
  /// Unset: a lost connection is an error, and the client of no further use.
  std::optional<Reconnect> reconnect{};
};

/// The first line of a file. Throws Error when it cannot be read, is empty, holds blanks or more
/// than 256 bytes, or when users other than its owner may read it.
DTACT_EXPORT [[nodiscard]] std::string read_token(const std::filesystem::path& file);

}  // namespace dtact::client
