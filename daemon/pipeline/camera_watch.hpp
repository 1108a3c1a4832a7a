#pragma once

#include <cstdint>

#include "daemon/pipeline/rate_watch.hpp"
#include "hal/camera.hpp"

namespace dtact::pipeline {

/// What grab() said lately, as conditions. One thread.
class CameraWatch {
 public:
  explicit CameraWatch(std::int64_t period_ns) noexcept : period_ns_(period_ns), rate_(period_ns) {}

  /// Silence is counted from here.
  void started(std::int64_t now_ns) noexcept { last_ns_ = now_ns; }
  /// A frame came. True when the camera had been away or was opened anew (a stalled one is, without
  /// ever having been away): what was known of its image is in doubt.
  bool arrived(const hal::FrameInfo& info, std::int64_t now_ns) noexcept;
  /// grab() came back without one.
  void missed(hal::GrabStatus status, std::int64_t now_ns) noexcept;

  /// Unplugged or ended: no frame comes unless the device returns.
  [[nodiscard]] bool away() const noexcept { return away_; }
  /// Away, or without a usable frame for longer than hal::stall_ns().
  [[nodiscard]] bool trouble() const noexcept { return away_ || stalled_; }
  /// What came last was a damaged frame.
  [[nodiscard]] bool damaged() const noexcept { return damaged_; }
  [[nodiscard]] std::int64_t silent_ns(std::int64_t now_ns) const noexcept {
    return now_ns - last_ns_;
  }
  /// The camera lost a frame within the last second, or sent a damaged one. Frames that were
  /// skipped for a newer one are not lost.
  [[nodiscard]] bool lost_lately(std::int64_t now_ns) const noexcept {
    return lost_ && now_ns - lost_ns_ < 1'000'000'000;
  }
  [[nodiscard]] const RateWatch& rate() const noexcept { return rate_; }

 private:
  void lose(std::int64_t now_ns) noexcept;

  std::int64_t period_ns_;
  RateWatch rate_;
  std::int64_t last_ns_ = 0;
  std::int64_t lost_ns_ = 0;
  bool lost_ = false;
  bool away_ = false;
  bool stalled_ = false;
  bool damaged_ = false;
};

}  // namespace dtact::pipeline
