#pragma once

#include <cstdint>
#include <optional>

#include "hal/frame.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// Estimated start of a frame's exposure, CLOCK_MONOTONIC nanoseconds. Unless the timestamp is
/// that of the start itself, it is assumed to lie a frame period after it. Any longer delay in the
/// camera is part of its light_delay_frames.
[[nodiscard]] std::int64_t exposure_start_ns(const hal::FrameInfo& info,
                                             std::int64_t period_ns) noexcept;

/// From an exposure's beginning to the frame's timestamp, by the same rule.
[[nodiscard]] std::int64_t stamp_lag_ns(hal::TimestampMeaning meaning,
                                        std::int64_t period_ns) noexcept;

/// Matches frames with light changes by time. A change has a start (just before the write to the
/// ring) and an end (just after it). It is complete in frames whose exposure began at least
/// the camera's delay after the end.
class LightTimeline {
 public:
  LightTimeline(const hal::Light& light, int delay_frames, std::int64_t period_ns) noexcept
      : before_(light), now_(light), delay_ns_(delay_frames * period_ns) {}

  void change_begins(const hal::Light& light, std::int64_t at_ns) noexcept;
  /// `light` is what the ring shows now: the old one when the write failed, which leaves it
  /// unknown since when.
  void change_ends(const hal::Light& light, std::int64_t at_ns, bool failed) noexcept;

  /// What the ring shows, or is about to while a write is under way.
  [[nodiscard]] const hal::Light& light() const noexcept { return now_; }
  /// What the ring showed when an exposure began.
  [[nodiscard]] const hal::Light& light_at(std::int64_t exposure_ns) const noexcept {
    return exposure_ns < began_ns_ ? before_ : now_;
  }
  /// Exposures that began at this moment or later show that light alone; none: not known yet.
  [[nodiscard]] std::optional<std::int64_t> since_at(std::int64_t exposure_ns) const noexcept {
    return exposure_ns < began_ns_ ? before_since_ns_ : now_since_ns_;
  }
  /// From a change's end to the first exposure that shows nothing of the light before.
  [[nodiscard]] std::int64_t delay_ns() const noexcept { return delay_ns_; }
  /// The frame whose exposure began then shows the present light and nothing of an earlier one.
  [[nodiscard]] bool settled_at(std::int64_t exposure_ns) const noexcept {
    return !writing_ && exposure_ns >= settled_from_ns_;
  }

 private:
  hal::Light before_;
  hal::Light now_;
  std::int64_t delay_ns_;
  std::int64_t began_ns_ = INT64_MIN;
  std::int64_t settled_from_ns_ = INT64_MIN;
  std::optional<std::int64_t> before_since_ns_;
  std::optional<std::int64_t> now_since_ns_;
  bool writing_ = false;
};

}  // namespace dtact::pipeline
