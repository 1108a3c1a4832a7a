#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/net/overview.hpp"
#include "daemon/serve/net_config.hpp"

namespace boost::asio {
class io_context;
}

namespace dtact::pipeline {
class Port;
}

namespace dtact::net {

class CalibrationStore;

/// The network part as a whole: listens, talks to clients and is the only caller of `port` and
/// `store`. Works on the thread that runs `io`, plus one worker thread for calibration files.
class Server {
 public:
  /// Listens from here on; clients are served once `io` runs. `io`, `port` and `store` must outlive
  /// the server. Throws std::runtime_error naming the setting, file, address or port and the
  /// fix.
  Server(boost::asio::io_context& io, NetConfig config, pipeline::Port& port,
         CalibrationStore& store);
  /// Calls stop(). `io` must not be running.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// What GetStatus answers, and what else is counted. On the thread that runs `io`.
  [[nodiscard]] Overview overview() const;
  /// Where it listens, as Endpoint.address; a Unix socket first, TCP last.
  [[nodiscard]] std::vector<std::string> addresses() const;
  /// The TCP port it listens on; 0 without TCP.
  [[nodiscard]] std::uint16_t port() const;
  /// Reloads certificate, key and tokens, even if their file names are unchanged, and takes
  /// the limits of `fresh`, for future clients; ends those whose token is gone. Whether TLS and
  /// tokens are in use, and everything else, stays. Throws as the constructor, then without any
  /// change. On the thread that runs `io`.
  void reload(const NetConfig& fresh);
  /// Takes no more clients and ends every connection; then `io` has no work of ours left and run()
  /// returns. On the thread that runs `io`, or while none does.
  void stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dtact::net
