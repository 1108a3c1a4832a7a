#include "clients/common/listen_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>

namespace dtact::cli {

void add_listen_options(CLI::App& command, net::NetConfig& settings) {
  settings.names = {.address = "--listen ",
                    .tls_certificate = "--tls-certificate",
                    .tls_key = "--tls-key",
                    .tokens = "--tokens",
                    .insecure = "--listen-insecure"};
  command
      .add_option("--listen", settings.address,
                  "Address to listen on; beyond this machine it needs TLS and tokens")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command.add_option("--listen-port", settings.port, "TCP port to listen on; 0: any free one")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  command
      .add_option("--tokens", settings.token_file,
                  "Clients need one of these tokens: a file like the daemon's net.tokens")
      ->type_name("FILE");
  command
      .add_option("--tls-certificate", settings.tls_certificate,
                  "Speak TLS only, with this certificate (PEM)")
      ->type_name("FILE");
  command.add_option("--tls-key", settings.tls_key, "The certificate's key (PEM)")
      ->type_name("FILE");
  command.add_flag(
      "--listen-insecure", settings.insecure,
      "Listen beyond this machine without TLS or tokens: every host that reaches it may "
      "connect");
}

void reload_at_hangup(boost::asio::signal_set& hangups, const net::Log& log,
                      const std::function<void()>& reload) {
  hangups.async_wait([&hangups, &log, reload](const boost::system::error_code& error, int) {
    if (error) return;
    try {
      reload();
      log({net::LogLevel::info, "certificate, key and tokens read again"});
    } catch (const std::exception& e) {
      log({net::LogLevel::warning, fmt::format("everything stays as it was: {}", e.what())});
    }
    reload_at_hangup(hangups, log, reload);
  });
}

}  // namespace dtact::cli
