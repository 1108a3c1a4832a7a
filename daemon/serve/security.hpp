#pragma once

#include <boost/asio/ip/address.hpp>
#include <chrono>
#include <optional>
#include <string>

#include "daemon/serve/net_config.hpp"

namespace dtact::net {

/// See dtact.v1.Endpoint.
struct EndpointInfo {
  std::string address;
  bool tls = false;
  bool token = false;
  bool insecure = false;
  std::string fingerprint;
  std::optional<std::chrono::sys_seconds> certificate_expires = {};
};

/// The TCP address. Throws std::runtime_error with the fix when it is none.
[[nodiscard]] boost::asio::ip::address listen_address(const NetConfig& config);
/// Whether the TCP address is one that other machines reach; not when it is no address.
[[nodiscard]] bool reaches_beyond(const NetConfig& config);
/// Whether the address is reachable without TLS or without a token, see Endpoint.insecure.
[[nodiscard]] bool is_insecure(const NetConfig& config);

/// Throws std::runtime_error, naming the keys and the fixes, when the address is none, the settings
/// open the daemon to the network without TLS and token and without stating that intent, or name
/// half a TLS pair.
void check_security(const NetConfig& config);
/// `config` after check_security(), with a log that unauthenticated clients cannot fill. Warns of
/// what it leaves open.
[[nodiscard]] NetConfig checked(NetConfig config);

}  // namespace dtact::net
