#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/fakes/notify_socket.hpp"

namespace dtact::e2e {

/// A folder of the test's own, removed with it.
class TempFolder {
 public:
  TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Runs a program to its end. Returns its exit status (128 + signal when it was killed); `output`
/// receives what it printed on both streams; `input` is what it reads.
int run_program(const std::vector<std::string>& arguments, std::string* output = nullptr,
                const std::string& input = "");

/// Variables beside those of this program.
using Environment = std::vector<std::pair<std::string, std::string>>;

/// A dtactd of the test's own on a port that the system chose. Started the way systemd
/// starts it: ready when it says READY=1 on its notify socket.
class DaemonProcess {
 public:
  /// `arguments` follow the program's name, `environment` adds to this program's. Throws
  /// std::runtime_error with the log when the daemon ends or is not ready within 60 s (kSlower).
  explicit DaemonProcess(const std::vector<std::string>& arguments, Environment environment = {});
  DaemonProcess(const DaemonProcess&) = delete;
  DaemonProcess& operator=(const DaemonProcess&) = delete;
  ~DaemonProcess();

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] std::string log() const;
  /// What the daemon tells systemd next; none when nothing comes in time.
  [[nodiscard]] std::optional<std::string> next_notification(
      std::chrono::milliseconds timeout) const {
    return notify_.next(timeout);
  }
  /// Sends `signal` and waits. Returns the exit status, 128 + signal when it was killed, or −1 when
  /// it did not end within 20 s (it is killed then).
  int stop(int signal);

 private:
  void wait_until_ready();

  TempFolder folder_;
  fakes::NotifySocket notify_;
  pid_t pid_ = -1;
  std::uint16_t port_ = 0;
};

}  // namespace dtact::e2e
