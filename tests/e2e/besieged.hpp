#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {

/// Limits of growth after an attack, where nothing may be held.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
// Sanitizers keep up to 256 MiB of freed memory, to detect its use (quarantine_size_mb).
inline constexpr std::int64_t kMemorySlackKib = (256 + 8) * 1024;
#else
inline constexpr std::int64_t kMemorySlackKib = 8 * 1024;
#endif

/// Resources of a process, as the kernel counts them.
struct Held {
  std::int64_t resident_kib = 0;  ///< VmRSS; with ONFAULT that is also what is locked.
  std::int64_t peak_kib = 0;      ///< VmHWM, since forget_peak().
  int descriptors = 0;
};
[[nodiscard]] Held held_by(pid_t pid);
void forget_peak(pid_t pid);

/// A client that does nothing but stream depth, on a thread of its own.
class HonestClient {
 public:
  explicit HonestClient(client::Client client);
  ~HonestClient();
  HonestClient(const HonestClient&) = delete;
  HonestClient& operator=(const HonestClient&) = delete;

  /// Waits for `frames` more frames. False when the connection broke or none came for a minute.
  [[nodiscard]] bool receives(std::size_t frames) const;
  /// Latency from capture to here of all frames since the last call, 99th percentile, milliseconds.
  [[nodiscard]] double take_p99_ms();
  /// Why the connection ended; empty while it lives.
  [[nodiscard]] std::string broken() const;

 private:
  void run();

  client::Client client_;
  mutable std::mutex mutex_;
  std::vector<std::int64_t> delays_ns_;
  std::string broken_;
  std::atomic<std::size_t> frames_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A daemon on the simulated sensor with an honest client, before and after an attack.
class Besieged {
 public:
  /// `settings`: of the daemon, KEY=VALUE.
  explicit Besieged(const std::vector<std::string>& settings = {});

  [[nodiscard]] std::uint16_t port() const { return sensor_.daemon->port(); }
  [[nodiscard]] const Sensor& sensor() const { return sensor_; }
  [[nodiscard]] pid_t pid() const { return sensor_.daemon->pid(); }
  [[nodiscard]] HonestClient& honest() { return honest_; }

  /// Resources noted by begin().
  [[nodiscard]] const Held& before() const { return before_; }

  /// Notes the state after a second without an attack.
  void begin();
  /// Asserts that nothing of the attack is left: memory, descriptors, the honest client, service
  /// for new clients. Prints the cost; a loaded machine misses frames by itself, which is not a
  /// failure.
  void end(const std::string& attack);

 private:
  struct Missed {
    std::uint64_t lost = 0;
    std::uint64_t skipped = 0;
    std::uint64_t replaced = 0;
  };
  [[nodiscard]] Missed missed() const;

  Sensor sensor_;
  HonestClient honest_;
  Held before_;
  Missed missed_before_;
  double idle_p99_ms_ = 0;
};

}  // namespace dtact::e2e
