#pragma once

#include <stdexcept>
#include <string>

namespace dtact::client {

/// What all of the library's exceptions are. The text is a sentence for the user and names the
/// remedy.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// No connection, or it broke. The client is of no further use: make another one.
class ConnectionError : public Error {
 public:
  using Error::Error;
};

/// The daemon did not answer in time. The client is of no further use.
class TimeoutError : public ConnectionError {
 public:
  using ConnectionError::ConnectionError;
};

/// The other side does not speak this wire, or another version of it.
class ProtocolError : public ConnectionError {
 public:
  using ConnectionError::ConnectionError;
};

/// Documented in dtact.proto, ErrorCode; the values are those of the wire.
enum class Code {
  none = 0,
  bad_message = 1,
  too_large = 2,
  version = 3,
  invalid = 4,
  contact = 5,
  device = 6,
  busy = 7,
  uncalibrated = 8,
  storage = 9
};

/// The daemon refused a request. The connection goes on.
class Refused : public Error {
 public:
  Refused(Code code, const std::string& sentence) : Error(sentence), code_(code) {}
  [[nodiscard]] Code code() const noexcept { return code_; }

 private:
  Code code_;
};

}  // namespace dtact::client
