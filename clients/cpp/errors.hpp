#pragma once

#include <stdexcept>
#include <string>

#include "clients/cpp/export.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {

/// Base of all exceptions of the library. The text is a sentence for the user that names the fix.
/// Error itself is thrown for invalid options, and to a second thread or a forked process that uses
/// a client.
class DTACT_EXPORT Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// No connection, or it broke. Without Options::reconnect the client is unusable: make a new one.
/// With it the client tries again by itself, except after the two below.
class DTACT_EXPORT ConnectionError : public Error {
 public:
  using Error::Error;
};

/// The other side does not speak this protocol, or speaks another version of it.
class DTACT_EXPORT ProtocolError : public ConnectionError {
 public:
  using ConnectionError::ConnectionError;
};

/// Not the daemon that Options::tls requires, or no way to verify it before a token is sent.
class DTACT_EXPORT IdentityError : public ConnectionError {
 public:
  using ConnectionError::ConnectionError;
};

/// The daemon closed the connection with a reason: too many clients (ERROR_BUSY), too many requests
/// (ERROR_FLOOD), or a request that it could not read.
class DTACT_EXPORT EndedByDaemon : public ConnectionError {
 public:
  EndedByDaemon(v1::ErrorCode code, const std::string& sentence)
      : ConnectionError(sentence), code_(code) {}
  [[nodiscard]] v1::ErrorCode code() const noexcept { return code_; }

 private:
  v1::ErrorCode code_;
};

/// The daemon did not answer a request in time. The connection stays open; a late answer is
/// ignored.
class DTACT_EXPORT TimeoutError : public ConnectionError {
 public:
  using ConnectionError::ConnectionError;
};

/// The daemon refused a request. The connection stays open.
class DTACT_EXPORT Refused : public Error {
 public:
  Refused(v1::ErrorCode code, const std::string& sentence) : Error(sentence), code_(code) {}
  [[nodiscard]] v1::ErrorCode code() const noexcept { return code_; }
  /// The token is missing or wrong, or its rights do not suffice.
  [[nodiscard]] bool denied() const noexcept { return code_ == v1::ERROR_DENIED; }
  /// The server does not know the request, or a value in it.
  [[nodiscard]] bool unsupported() const noexcept { return code_ == v1::ERROR_UNSUPPORTED; }
  /// The same request may be granted later without any change.
  [[nodiscard]] bool is_transient() const noexcept {
    return code_ == v1::ERROR_BUSY || code_ == v1::ERROR_CONTACT;
  }

 private:
  v1::ErrorCode code_;
};

}  // namespace dtact::client
