#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "daemon/pipeline/exchange.hpp"
#include "daemon/pipeline/port.hpp"
#include "daemon/pipeline/spsc_queue.hpp"
#include "hal/base/clock.hpp"
#include "hal/base/doorbell.hpp"
#include "hal/base/rt_thread.hpp"

namespace dtact::pipeline {

/// What the capture thread has to know of a write to the ring or to the camera's settings.
struct LightNote {
  bool begins = false;     ///< The write is about to begin; else it is over.
  std::int64_t at_ns = 0;  ///< CLOCK_MONOTONIC.
  hal::Light light;        ///< What the ring is to show, or shows.
  /// The ring was away, or its last write failed, until this one: what it showed is not known.
  bool returned = false;
  bool failed = false;  ///< The write did not work.
  bool camera = false;  ///< The ring stays: the camera's exposure or gain has been changed.
};

/// Owns the ring and the one thread that uses it: it writes, re-sends and executes commands, since
/// a write blocks for at least a millisecond. Exposure and gain are set on it, too: to the picture
/// they are a change of the light.
/// Commands come from the network thread, events return there, notes go to the capture thread.
/// Each has a queue of its own that never drops (a full one makes this thread wait).
///
/// A light requested while the ring is away fails for the caller but is kept: the ring shows it
/// when it is back.
class LightDriver {
 public:
  /// `exchange` is where events are announced, and the newest frame is known. `camera` is that of
  /// SetCamera.
  LightDriver(std::unique_ptr<hal::LightRing> ring, const hal::Light& light, base::Clock& clock,
              const Exchange& exchange, hal::Camera* camera = nullptr);
  LightDriver(const LightDriver&) = delete;
  LightDriver& operator=(const LightDriver&) = delete;
  ~LightDriver() { stop(); }

  /// Shows the first light on the calling thread, notifies the capture thread, starts the thread.
  void start();
  /// Ends and joins the thread, after the write it is in, and lets the ring go: it turns dark
  /// unless it stays on by configuration. It does not start again.
  void stop() noexcept;

  // Network thread.
  /// A SetLight or a SetCamera.
  [[nodiscard]] bool submit(Command command);
  [[nodiscard]] bool next_event(Event& out) { return events_.pop(out); }
  [[nodiscard]] const hal::RingInfo& info() const { return info_; }
  /// The last error, or why the ring shows less light than requested, or another remark on it;
  /// empty when well.
  [[nodiscard]] std::string message() const;
  [[nodiscard]] hal::Light light() const;
  /// As Status::light_requested.
  [[nodiscard]] hal::Light requested() const;
  /// As DepthFrame::light_since_ns, of light().
  [[nodiscard]] std::optional<std::int64_t> light_since_ns() const;

  // Capture thread.
  [[nodiscard]] bool next_note(LightNote& out) noexcept { return notes_.pop(out); }
  [[nodiscard]] bool trouble() const noexcept { return trouble_.load(std::memory_order_relaxed); }

 private:
  void run();
  void serve(Command command);
  void set_camera(Command command);
  std::chrono::nanoseconds attend();
  void come_back();
  void recover();
  hal::ShowResult write(const hal::Light& light);
  void note(const LightNote& note);
  void emit(const Event& event);
  [[nodiscard]] LightChanged changed() const;

  std::unique_ptr<hal::LightRing> ring_;
  const hal::RingInfo info_;
  base::Clock& clock_;
  const Exchange& exchange_;
  hal::Camera* const camera_;
  SpscQueue<Command, 16> commands_;
  SpscQueue<Event, 64> events_;
  SpscQueue<LightNote, 16> notes_;
  base::Doorbell work_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> trouble_{false};
  mutable std::mutex mutex_;  // between this thread and the network thread, held for a copy
  hal::Light light_;          // the last that was shown; the ring re-sends it
  hal::Light requested_;      // shown when the ring is back
  int waiting_ = 0;           // commands
  std::optional<std::int64_t> shown_ns_;  // CLOCK_MONOTONIC of its write; none: not known
  std::string message_;
  std::string note_;
  // This thread's own:
  bool away_ = false;      // when looked at last
  base::RtThread thread_;  // last: it uses all the others
};

}  // namespace dtact::pipeline
