#include "daemon/serve/security.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "daemon/serve/limited_log.hpp"

namespace dtact::net {
namespace {

/// What a client without a token may do.
const char* anyone_may(const NetConfig& config) {
  return config.token_file.empty() && config.anonymous_rights > Rights::view ? "watch and command"
                                                                             : "watch";
}

}  // namespace

boost::asio::ip::address listen_address(const NetConfig& config) {
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(config.address, error);
  if (!error) return address;
  throw std::runtime_error(fmt::format(
      "\"{}\" is not an IPv4 or IPv6 address to listen on: write 127.0.0.1 for this machine "
      "only, 0.0.0.0 or :: for every interface",
      config.address));
}

bool reaches_beyond(const NetConfig& config) {
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(config.address, error);
  return !error && !address.is_loopback();
}

bool is_insecure(const NetConfig& config) {
  return reaches_beyond(config) && (config.tls_certificate.empty() || config.token_file.empty());
}

void check_security(const NetConfig& config) {
  const SettingNames& names = config.names;
  if (!config.address.empty()) (void)listen_address(config);
  if (config.tls_certificate.empty() != config.tls_key.empty()) {
    throw std::runtime_error(
        fmt::format("only one of {} and {} is set: set both or none; dtactctl cert makes a pair",
                    names.tls_certificate, names.tls_key));
  }
  if (!is_insecure(config) || config.insecure) return;
  std::string missing;
  if (config.tls_certificate.empty()) {
    missing =
        fmt::format("{} and {} (dtactctl cert makes a pair)", names.tls_certificate, names.tls_key);
  }
  if (config.token_file.empty()) {
    if (!missing.empty()) missing += " and ";
    missing += names.tokens;
    missing += " (dtactctl token --new control -o FILE prints a line for it)";
  }
  throw std::runtime_error(
      fmt::format("{0}\"{1}\" opens the sensor to other machines, which needs TLS and a token: set "
                  "{2}; or {3}, "
                  "if every host that reaches it may {4}; or {0}\"127.0.0.1\"",
                  names.address, config.address, missing, names.insecure, anyone_may(config)));
}

NetConfig checked(NetConfig config) {
  check_security(config);
  if (is_insecure(config)) {
    config.log(
        {LogLevel::warning,
         fmt::format("{}: every host that reaches {} may {} the sensor, since there is no {}",
                     config.names.insecure, config.address, anyone_may(config),
                     config.token_file.empty() ? "token" : "TLS to keep a token secret")});
  }
  config.log = limited(std::move(config.log));
  return config;
}

}  // namespace dtact::net
