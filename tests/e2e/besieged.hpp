#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {

/// Freed memory that the address sanitizer keeps to detect its use (quarantine_size_mb). Its
/// default of 256 MiB would hide what the daemon holds.
inline constexpr int kQuarantineMib = 16;

/// Limits of growth after an attack, where nothing may be held, and of what is held at any time.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr std::int64_t kMemorySlackKib = (kQuarantineMib + 8) * 1024;
inline constexpr std::int64_t kMaxResidentKib = 1024 * 1024;
#elif defined(__SANITIZE_THREAD__)
// Shadow memory stays resident where the memory itself was given back.
inline constexpr std::int64_t kMemorySlackKib = (256 + 8) * 1024;
inline constexpr std::int64_t kMaxResidentKib = 1024 * 1024;
#else
inline constexpr std::int64_t kMemorySlackKib = 8 * 1024;
inline constexpr std::int64_t kMaxResidentKib = 150 * 1024;
#endif

/// Resources of a process, as the kernel counts them.
struct Held {
  std::int64_t resident_kib = 0;  ///< VmRSS; with ONFAULT that is also what is locked.
  std::int64_t peak_kib = 0;      ///< VmHWM, since forget_peak().
  int descriptors = 0;
};
[[nodiscard]] Held held_by(pid_t pid);
void forget_peak(pid_t pid);

/// A viewer that does nothing but stream depth and a client that sends a command again and again,
/// each on a thread and a connection of its own.
class HonestClients {
 public:
  HonestClients(client::Client viewer, client::Client commander);
  ~HonestClients();
  HonestClients(const HonestClients&) = delete;
  HonestClients& operator=(const HonestClients&) = delete;

  /// Waits for `frames` more frames and a command. False when a connection broke, a command was
  /// refused or none came for a minute.
  [[nodiscard]] bool receive(std::size_t frames) const;
  /// What they got since the last call.
  struct Served {
    double p99_ms = 0;  ///< Latency of the frames, from capture to here.
    std::uint64_t frames = 0;
    std::uint64_t missed = 0;  ///< Frames that the daemon made and did not send.
    std::size_t commands = 0;
    /// Frames that came while the slowest command waited: time that a busy machine does not
    /// stretch.
    std::uint64_t slowest = 0;
  };
  [[nodiscard]] Served take();
  /// Why a connection ended; empty while both live.
  [[nodiscard]] std::string broken() const;

 private:
  void view(client::Client client);
  void command(client::Client client);

  mutable std::mutex mutex_;
  std::vector<std::int64_t> delays_ns_;
  std::uint64_t dropped_ = 0;  ///< Since the viewer connected.
  Served served_;
  std::string broken_;
  std::atomic<std::uint64_t> frames_{0};
  std::atomic<std::uint64_t> commands_{0};
  std::atomic<bool> stop_{false};
  std::thread viewer_;
  std::thread commander_;
};

/// A daemon on the simulated sensor with honest clients, before, during and after attacks. Asserts
/// at its end that the daemon has not crashed.
class Besieged {
 public:
  /// `settings`: of the daemon, KEY=VALUE. `tls`: of the honest clients.
  explicit Besieged(const std::vector<std::string>& settings = {},
                    const std::optional<client::Tls>& tls = {});
  ~Besieged();
  Besieged(const Besieged&) = delete;
  Besieged& operator=(const Besieged&) = delete;

  [[nodiscard]] std::uint16_t port() const { return sensor_.daemon->port(); }
  [[nodiscard]] const Sensor& sensor() const { return sensor_; }
  [[nodiscard]] pid_t pid() const { return sensor_.daemon->pid(); }
  [[nodiscard]] HonestClients& honest() { return honest_; }

  /// Resources at rest: before the first attack.
  [[nodiscard]] const Held& at_rest() const { return at_rest_; }

  /// Notes the state after a second without an attack.
  void begin();
  /// Asserts that memory stayed within bounds, that the honest clients were served throughout and
  /// that nothing of the attack is left: memory, descriptors, service for new clients. Prints the
  /// cost; a loaded machine misses frames of the camera by itself, which is not a failure.
  void end(const std::string& attack);

 private:
  struct Missed {
    std::uint64_t lost = 0;
    std::uint64_t skipped = 0;
    std::uint64_t replaced = 0;
  };
  [[nodiscard]] Missed missed() const;

  Sensor sensor_;
  HonestClients honest_;
  Held at_rest_;
  Missed missed_before_;
  double idle_p99_ms_ = 0;
};

}  // namespace dtact::e2e
