#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "daemon/serve/net_config.hpp"

namespace dtact::net {

/// The daemon's side of TLS 1.2 and 1.3.
struct Tls {
  /// Reads a PEM certificate, with those that signed it behind it if any, and its PEM key. Throws
  /// std::runtime_error naming the file and the fix: unreadable, a key that others may read, one
  /// that wants a pass phrase or belongs to another certificate. One that has expired is served:
  /// clients that pin its fingerprint do not look at its dates.
  Tls(const std::filesystem::path& certificate, const std::filesystem::path& key);

  boost::asio::ssl::context context;
  std::string fingerprint;  ///< As Endpoint.fingerprint.
  std::chrono::sys_seconds expires;
};

/// Loads the files that the settings name; null when they name none. Throws as Tls.
[[nodiscard]] std::unique_ptr<Tls> make_tls(const NetConfig& config);

/// Whole days from `now` until then, rounded down; negative: it is past.
[[nodiscard]] int days_until(std::chrono::sys_seconds then, std::chrono::sys_seconds now);

/// Warns in the log once a day from 30 days before the certificate expires. On the thread that runs
/// `io`.
class CertificateWatch {
 public:
  /// `tls` may be null, and another one later. What is passed must outlive it.
  CertificateWatch(boost::asio::io_context& io, const NetConfig& config,
                   const std::unique_ptr<Tls>& tls);

  /// Checks now, and from then on once a day: at the start, and when the certificate is another
  /// one.
  void check();
  /// Leaves no work for `io`.
  void stop();

 private:
  const NetConfig& config_;
  const std::unique_ptr<Tls>& tls_;
  boost::asio::steady_timer timer_;
  bool stopped_ = false;
};

}  // namespace dtact::net
