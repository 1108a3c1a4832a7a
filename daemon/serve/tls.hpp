#pragma once

#include <boost/asio/ssl/context.hpp>
#include <filesystem>
#include <memory>
#include <string>

#include "daemon/serve/net_config.hpp"

namespace dtact::net {

/// The daemon's side of TLS 1.2 and 1.3.
struct Tls {
  /// Reads a PEM certificate, with those that signed it behind it if any, and its PEM key. Throws
  /// std::runtime_error naming the file and the fix: unreadable, a key that others may read, one
  /// that wants a pass phrase or belongs to another certificate, a certificate out of date.
  Tls(const std::filesystem::path& certificate, const std::filesystem::path& key);

  boost::asio::ssl::context context;
  std::string fingerprint;  ///< As Endpoint.fingerprint.
};

/// Loads the files that the settings name; null when they name none. Throws as Tls.
[[nodiscard]] std::unique_ptr<Tls> make_tls(const NetConfig& config);

}  // namespace dtact::net
