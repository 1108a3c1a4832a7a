#pragma once

#include <sched.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "hal/camera.hpp"
#include "hal/config.hpp"
#include "hal/live/frame_leases.hpp"
#include "hal/live/payload.hpp"
#include "hal/live/source.hpp"

namespace dtact::hal::live {

/// Common part of every real camera, whatever library accesses it. The camera may be absent,
/// busy or forbidden, at the start and later. Then grab() returns `unplugged`, the report gives the
/// reason, and the opener is called ten times a second until the camera streams again, with its
/// controls locked.
///
/// A second thread reads the locked controls once a second (a USB transfer each, too slow for the
/// capture thread) and restores changed ones.
class LiveCamera : public Camera {
 public:
  /// `opener` is called by start() and then whenever the camera is away. Messages use `identity`
  /// until it has succeeded. Throws std::runtime_error for an impossible size or rate.
  LiveCamera(const CameraConfig& config, const std::string& backend, const std::string& identity,
             Opener opener);
  ~LiveCamera() override;

  [[nodiscard]] CameraInfo info() const override;
  [[nodiscard]] CameraReport report() const override;
  /// Throws only when the attached camera lacks the mode asked for. A camera that is away, busy or
  /// forbidden is a state of the report, since it may come back.
  void start() override;
  void will_read(const Area& area) noexcept override;
  void change(const CameraChange& change) override;
  [[nodiscard]] GrabStatus grab(Frame& out, std::chrono::nanoseconds timeout) noexcept override;

 private:
  /// An open device. The watching thread may hold it a little longer than the capture thread, and
  /// so may a frame that was lent.
  struct Connection {
    Connection(const std::shared_ptr<Source>& s, int decode_scale)
        : source(s), decoder(s->format(), decode_scale) {}
    std::shared_ptr<Source> source;
    PayloadDecoder decoder;
  };

  void connect();
  [[nodiscard]] bool try_connect() noexcept;
  void disconnect(CameraState state, const std::string& fix);
  void lose(const char* what) noexcept;
  [[nodiscard]] bool wait_for_device(std::int64_t deadline_ns) noexcept;
  /// Since the last buffer, or since the stream began.
  [[nodiscard]] std::int64_t silence_ns(std::int64_t now_ns) const noexcept;
  [[nodiscard]] std::int64_t tolerated_silence_ns() const noexcept;
  void note_silence(std::int64_t now_ns) noexcept;
  void note_damage(std::int64_t now_ns) noexcept;
  void stall(const char* what) noexcept;
  void restart(std::int64_t now_ns) noexcept;
  /// What collect() found in the driver's queue.
  enum class Collected : std::uint8_t { frame, damaged, nothing, lost };
  [[nodiscard]] Collected collect(Frame& out) noexcept;
  [[nodiscard]] FrameInfo facts_of(const FilledBuffer& filled,
                                   std::uint64_t sequence) const noexcept;
  void note_delivery() noexcept;
  [[nodiscard]] Collected take(FilledBuffer& out) noexcept;
  void count_gap(std::uint32_t sequence) noexcept;
  void count_damage(PayloadStatus status) noexcept;
  void watch_controls() noexcept;

  const Opener open_;
  const std::int64_t period_ns_;
  const int decode_scale_;
  const cpu_set_t cpus_;  // that the thread which made this may use

  // The capture thread's own.
  FrameLeases leases_;
  std::optional<Area> area_;  // what will be read; none: the whole image
  std::int64_t next_try_ns_ = 0;
  std::int64_t last_buffer_ns_ = 0;  // the last sign of life, damaged or not
  std::int64_t opened_ns_ = 0;
  std::int64_t delivered_ns_ = 0;              // the last whole frame, or the opening
  std::uint64_t sequence_ = 0;                 // of the last buffer, never going back
  std::optional<std::uint32_t> last_counted_;  // the driver's count of the last buffer
  int buffers_free_ = 0;          // with the driver when its queue was last found empty
  int taken_in_a_row_ = 0;        // buffers since then
  bool driver_was_full_ = false;  // no buffer was left to fill after the newest one taken
  bool after_gap_ = false;
  bool reopened_ = false;

  // Held while controls are read or changed: what a client changes is not a control that moved.
  std::mutex controls_mutex_;  // before mutex_
  // Shared. The mutex is held for copies only, never during a system call.
  mutable std::mutex mutex_;
  std::condition_variable wake_watcher_;
  std::shared_ptr<Connection> connection_;  // written by the capture thread only
  CameraInfo info_;
  std::string fix_;
  std::string moved_;
  CameraChange changed_;  // since the start; what a camera that comes back gets
  bool stopping_ = false;
  std::atomic<CameraState> state_{CameraState::unplugged};
  std::atomic<bool> controls_moved_{false};
  std::atomic<const char*> damage_reason_{nullptr};
  struct Counters {
    std::atomic<std::uint64_t> delivered, lost, skipped, disconnects;
    std::atomic<std::uint64_t> flagged, markers, too_short, undecodable;
  };
  static void add(std::atomic<std::uint64_t>& counter, std::uint64_t n = 1) noexcept {
    counter.fetch_add(n, std::memory_order_relaxed);
  }
  Counters counters_{};
  std::thread watcher_;  // last: it uses all of the above
};

}  // namespace dtact::hal::live
