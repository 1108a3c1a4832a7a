#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/serve/admission.hpp"
#include "daemon/serve/listener.hpp"
#include "daemon/serve/net_config.hpp"
#include "daemon/serve/security.hpp"
#include "daemon/serve/session.hpp"
#include "daemon/serve/tls.hpp"

namespace dtact::net {

/// Where clients come in: listens where the settings say, with TLS and tokens, and makes a Session
/// of each connection. On the thread that runs `io`.
class Listeners {
 public:
  /// Listens from here on. `io` must outlive it. Throws std::runtime_error naming the setting,
  /// file, address or port and the fix.
  Listeners(boost::asio::io_context& io, NetConfig settings);
  Listeners(const Listeners&) = delete;
  Listeners& operator=(const Listeners&) = delete;
  ~Listeners() = default;

  /// Accepts connections from now on and passes them to `admit`; their sessions notify `host`.
  void open(std::weak_ptr<SessionHost> host,
            std::function<void(const std::shared_ptr<Session>&)> admit);
  /// Takes no more of them.
  void close();
  /// Reads certificate, key and tokens again and takes the limits of `fresh`, for clients that
  /// come from now on; everything else stays. The sessions' owner then calls their
  /// end_if_revoked(). Throws as the constructor, and changes nothing then.
  void reload(const NetConfig& fresh);

  /// Where it listens; a Unix socket first, TCP last.
  [[nodiscard]] const std::vector<EndpointInfo>& endpoints() const noexcept { return endpoints_; }
  [[nodiscard]] std::vector<std::string> addresses() const;
  /// The TCP port it listens on; 0 without TCP.
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] const NetConfig& config() const noexcept { return config_; }

 private:
  NetConfig config_;
  std::unique_ptr<Tls> tls_;
  CertificateWatch certificate_watch_;
  Admission admission_;
  std::weak_ptr<SessionHost> host_;
  std::function<void(const std::shared_ptr<Session>&)> admit_;
  std::vector<std::shared_ptr<Listener>> listeners_;
  std::vector<EndpointInfo> endpoints_;
};

}  // namespace dtact::net
