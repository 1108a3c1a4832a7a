#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/camera.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// How fast a camera really takes frames, whatever its driver promises: the median interval of
/// their timestamps over about a second. An interval is shared among the frames that it spans, so
/// that lost frames are no slow camera. One thread; does not allocate.
class RateWatch {
 public:
  explicit RateWatch(std::int64_t promised_ns) noexcept : promised_ns_(promised_ns) {}

  void add(const hal::FrameInfo& info) noexcept;
  /// The camera was opened anew: its numbers and its rate begin again.
  void forget() noexcept;

  /// Frames a second, as last measured; 0 before the first second is over.
  [[nodiscard]] double fps() const noexcept;
  /// It is less than kSlow of what was promised.
  [[nodiscard]] bool slow() const noexcept;

  /// Cameras that lengthen the exposure leave out whole frames, halving the rate, or stretch them;
  /// 60 for 59.94 and clocks that are off by some per mille are no fault.
  static constexpr double kSlow = 0.9;

 private:
  static constexpr std::size_t kMax = 256;
  static constexpr std::size_t kMin = 5;  // for a median worth the name, however slow they come
  static constexpr std::int64_t kWindowNs = 1'000'000'000;

  std::int64_t promised_ns_;
  std::int64_t median_ns_ = 0;  // 0: not measured
  std::array<std::int64_t, kMax> intervals_{};
  std::size_t count_ = 0;
  std::int64_t span_ns_ = 0;  // of the intervals gathered
  bool have_before_ = false;
  std::uint64_t sequence_ = 0;  // of the frame before
  std::int64_t timestamp_ns_ = 0;
};

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
