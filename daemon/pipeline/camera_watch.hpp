#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/camera.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// The camera's real frame rate, whatever its driver promises: the median interval of the frame
/// timestamps over about a second. An interval is divided by the number of frames that it spans, so
/// lost frames do not look like a slow camera. One thread; does not allocate.
class RateWatch {
 public:
  explicit RateWatch(std::int64_t promised_ns) noexcept : promised_ns_(promised_ns) {}

  void add(const hal::FrameInfo& info) noexcept;
  /// The camera was reopened: sequence numbers and rate start again.
  void forget() noexcept;

  /// Frames per second, as last measured; 0 during the first second.
  [[nodiscard]] double fps() const noexcept;
  /// The rate is below kSlow of the promised one.
  [[nodiscard]] bool slow() const noexcept;

  /// Cameras that lengthen the exposure leave out whole frames, halving the rate, or stretch them;
  /// 60 for 59.94 and clocks that are off by some per mille are no fault.
  static constexpr double kSlow = 0.9;

 private:
  static constexpr std::size_t kMax = 256;
  static constexpr std::size_t kMin = 5;  // for a meaningful median, even of a slow camera
  static constexpr std::int64_t kWindowNs = 1'000'000'000;

  std::int64_t promised_ns_;
  std::int64_t median_ns_ = 0;  // 0: not measured
  std::array<std::int64_t, kMax> intervals_{};
  std::size_t count_ = 0;
  std::int64_t span_ns_ = 0;  // total of the gathered intervals
  bool have_before_ = false;
  std::uint64_t sequence_ = 0;  // the previous frame's
  std::int64_t timestamp_ns_ = 0;
};

/// Whether this machine keeps up with the camera: counts the frames that were skipped for newer
/// ones, over two seconds of frame timestamps at a time. One thread.
class SkipWatch {
 public:
  void add(const hal::FrameInfo& info) noexcept;
  /// A damaged frame took a sequence number: it was not skipped.
  void add_damaged() noexcept { ++damaged_; }
  /// The camera was reopened: sequence numbers start again.
  void forget() noexcept { *this = {}; }
  /// Of the last two seconds' frames more than kMaxSkipped were skipped.
  [[nodiscard]] bool behind() const noexcept { return behind_; }

  /// Other programs delay a machine that is fast enough by a few frames now and then.
  static constexpr double kMaxSkipped = 0.2;

 private:
  static constexpr std::int64_t kWindowNs = 2'000'000'000;

  bool have_before_ = false;
  std::uint64_t sequence_ = 0;  // the previous frame's
  std::int64_t began_ns_ = 0;   // of the window
  std::uint64_t frames_ = 0;    // processed or skipped since then
  std::uint64_t skipped_ = 0;
  std::uint64_t damaged_ = 0;  // since the previous frame
  bool behind_ = false;
};

/// The health flags that follow from the latest grab() results. One thread.
class CameraWatch {
 public:
  explicit CameraWatch(std::int64_t period_ns) noexcept : period_ns_(period_ns), rate_(period_ns) {}

  /// Starts the time-out for missing frames.
  void started(std::int64_t now_ns) noexcept { last_ns_ = now_ns; }
  /// A frame arrived. Returns true when the camera had been away or was reopened (a stalled one is
  /// reopened without having been away): what was known of its image is in doubt.
  bool arrived(const hal::FrameInfo& info, std::int64_t now_ns) noexcept;
  /// grab() returned without a frame.
  void missed(hal::GrabStatus status, std::int64_t now_ns) noexcept;

  /// Unplugged or ended: no frame arrives until the device returns.
  [[nodiscard]] bool away() const noexcept { return away_; }
  /// Away, or without a usable frame for longer than hal::stall_ns().
  [[nodiscard]] bool trouble() const noexcept { return away_ || stalled_; }
  /// The latest grab() returned a damaged frame.
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
  [[nodiscard]] const SkipWatch& skips() const noexcept { return skips_; }

 private:
  void lose(std::int64_t now_ns) noexcept;

  std::int64_t period_ns_;
  RateWatch rate_;
  SkipWatch skips_;
  std::int64_t last_ns_ = 0;
  std::int64_t lost_ns_ = 0;
  bool lost_ = false;
  bool away_ = false;
  bool stalled_ = false;
  bool damaged_ = false;
};

}  // namespace dtact::pipeline
