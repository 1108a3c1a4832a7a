#pragma once

#include <cstdint>

namespace dtact::wire {

/// The version this tree speaks. The daemon refuses another major version; a minor version only
/// adds fields.
inline constexpr std::uint32_t kMajor = 1;
inline constexpr std::uint32_t kMinor = 1;

/// The daemon's TCP port unless configured. From the range 7366–7390, which IANA's service name
/// and port number registry leaves unassigned.
inline constexpr std::uint16_t kDefaultPort = 7377;

/// dtact-perceive's own, from the same range.
inline constexpr std::uint16_t kPerceivePort = 7378;

/// dtact-web's own, which browsers are pointed at: from the same range.
inline constexpr std::uint16_t kWebPort = 7380;

/// Default address of the daemon, for listening and connecting: this machine only.
inline constexpr const char* kDefaultAddress = "127.0.0.1";

/// What the daemon is announced as in multicast DNS (RFC 6763).
inline constexpr const char* kServiceType = "_dtact._tcp";

/// Longest program name in Hello, bytes.
inline constexpr std::size_t kMaxProgramName = 64;

/// Longest token in Hello, bytes.
inline constexpr std::size_t kMaxToken = 256;

/// Bytes of ClientMessage.on_behalf_of that are logged.
inline constexpr std::size_t kMaxOnBehalfOf = 256;

/// Longest calibration name in UploadCalibration, bytes.
inline constexpr std::size_t kMaxCalibrationName = 64;

}  // namespace dtact::wire
