#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace boost::asio {
class io_context;
}

namespace dtact::metrics {

struct EndpointConfig {
  /// This machine's loopback, "127.0.0.1" or "::1": there is neither TLS nor a token here.
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  ///< 0 in the configuration: none. Here: any free one.
};

/// Answers GET /metrics over HTTP, one request a connection. Works on the thread that runs `io`,
/// and only on requests: at most a few connections at a time, each for a few seconds.
class Endpoint {
 public:
  /// Listens from here on. `text` makes the answer. Throws std::runtime_error naming address, port
  /// and fix.
  Endpoint(boost::asio::io_context& io, const EndpointConfig& config,
           std::function<std::string()> text);
  ~Endpoint();
  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  /// Takes no more connections and ends those that are open.
  void stop();

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace dtact::metrics
