#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

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
  static constexpr std::size_t kMost = 256;
  static constexpr std::size_t kLeast = 5;  // for a median worth the name, however slow they come
  static constexpr std::int64_t kWindowNs = 1'000'000'000;

  std::int64_t promised_ns_;
  std::int64_t median_ns_ = 0;  // 0: not measured
  std::array<std::int64_t, kMost> intervals_{};
  std::size_t count_ = 0;
  std::int64_t span_ns_ = 0;  // of the intervals gathered
  bool have_before_ = false;
  std::uint64_t sequence_ = 0;  // of the frame before
  std::int64_t timestamp_ns_ = 0;
};

}  // namespace dtact::pipeline
