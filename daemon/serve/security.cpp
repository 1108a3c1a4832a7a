#include "daemon/serve/security.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "daemon/serve/limited_log.hpp"

namespace dtact::net {

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
  if (!config.address.empty()) (void)listen_address(config);
  if (config.tls_certificate.empty() != config.tls_key.empty()) {
    throw std::runtime_error(fmt::format(
        "net.tls_certificate = \"{}\" and net.tls_key = \"{}\": set both or none; dtactctl cert "
        "makes a pair",
        config.tls_certificate.string(), config.tls_key.string()));
  }
  if (!is_insecure(config) || config.insecure) return;
  std::string missing;
  if (config.tls_certificate.empty()) {
    missing = "net.tls_certificate and net.tls_key (dtactctl cert makes a pair)";
  }
  if (config.token_file.empty()) {
    if (!missing.empty()) missing += " and ";
    missing += "net.tokens (dtactctl token --new control -o FILE prints a line for it)";
  }
  throw std::runtime_error(fmt::format(
      "net.address = \"{}\" opens the sensor to other machines, which needs TLS and a "
      "token: set {}; or net.listen_insecure = true, if every host that reaches it may watch "
      "and command; or net.address = \"127.0.0.1\"",
      config.address, missing));
}

NetConfig checked(NetConfig config) {
  check_security(config);
  if (is_insecure(config)) {
    config.log(
        {LogLevel::warning,
         fmt::format(
             "net.listen_insecure: every host that reaches {} may {} the sensor, since there is no "
             "{}",
             config.address,
             config.token_file.empty() && config.anonymous_rights > Rights::view
                 ? "watch and command"
                 : "watch",
             config.token_file.empty() ? "token" : "TLS to keep a token secret")});
  }
  config.log = limited(std::move(config.log));
  return config;
}

}  // namespace dtact::net
