#pragma once

#include <stdexcept>
#include <string>

#include "proto/dtact.pb.h"

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

/// The daemon refused a request. The connection goes on.
class Refused : public Error {
 public:
  Refused(v1::ErrorCode code, const std::string& sentence) : Error(sentence), code_(code) {}
  [[nodiscard]] v1::ErrorCode code() const noexcept { return code_; }

 private:
  v1::ErrorCode code_;
};

}  // namespace dtact::client
