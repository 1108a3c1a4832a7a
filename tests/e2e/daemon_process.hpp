#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/e2e/program.hpp"
#include "tests/fakes/notify_socket.hpp"

namespace dtact::e2e {

/// A dtactd on a port that the system chose. Started the way systemd
/// starts it: ready when it says READY=1 on its notify socket.
class DaemonProcess {
 public:
  /// `arguments` follow the program's name, `environment` adds to this program's. Throws
  /// std::runtime_error with the log when the daemon ends or is not ready within 60 s (kSlower).
  explicit DaemonProcess(const std::vector<std::string>& arguments, Environment environment = {});

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t pid() const { return program_.pid(); }
  [[nodiscard]] std::string log() const { return program_.log(); }
  /// The daemon's next message to systemd; nothing when none comes in time.
  [[nodiscard]] std::optional<std::string> next_notification(
      std::chrono::milliseconds timeout) const {
    return notify_.next(timeout);
  }
  /// See Program::stop().
  int stop(int signal) { return program_.stop(signal); }

 private:
  void wait_until_ready();

  TempFolder folder_;
  fakes::NotifySocket notify_;
  Program program_;
  std::uint16_t port_ = 0;
};

}  // namespace dtact::e2e
