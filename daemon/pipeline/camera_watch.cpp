#include "daemon/pipeline/camera_watch.hpp"

#include <algorithm>
#include <utility>

namespace dtact::pipeline {

void RateWatch::add(const hal::FrameInfo& info) noexcept {
  const std::int64_t passed_ns = info.timestamp_ns - timestamp_ns_;
  // A sequence number or a timestamp that does not increase says nothing about the rate.
  const bool goes_on = have_before_ && info.sequence > sequence_ && passed_ns > 0;
  const auto frames = static_cast<std::int64_t>(info.sequence - sequence_);
  have_before_ = true;
  sequence_ = info.sequence;
  timestamp_ns_ = info.timestamp_ns;
  if (!goes_on) return;
  intervals_[count_++] = passed_ns / frames;
  span_ns_ += passed_ns;
  if (count_ < kMax && (count_ < kMin || span_ns_ < kWindowNs)) return;
  const auto middle = intervals_.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
  std::nth_element(intervals_.begin(), middle,
                   intervals_.begin() + static_cast<std::ptrdiff_t>(count_));
  median_ns_ = *middle;
  count_ = 0;
  span_ns_ = 0;
}

void RateWatch::forget() noexcept {
  median_ns_ = 0;
  count_ = 0;
  span_ns_ = 0;
  have_before_ = false;
}

double RateWatch::fps() const noexcept {
  return median_ns_ == 0 ? 0 : 1e9 / static_cast<double>(median_ns_);
}

bool RateWatch::slow() const noexcept {
  return kSlow * static_cast<double>(median_ns_) > static_cast<double>(promised_ns_);
}

void SkipWatch::add(const hal::FrameInfo& info) noexcept {
  const bool goes_on = have_before_ && info.sequence > sequence_;
  const std::uint64_t passed = goes_on ? info.sequence - sequence_ : 0;
  sequence_ = info.sequence;
  if (!std::exchange(have_before_, true)) began_ns_ = info.timestamp_ns;
  frames_ += passed;
  // A gap in which the camera lost frames says nothing about this machine.
  const std::uint64_t gap = passed > 1 ? passed - 1 : 0;
  const std::uint64_t damaged = std::min(gap, std::exchange(damaged_, 0));
  if ((info.flags & hal::kFrameAfterGap) == 0) skipped_ += gap - damaged;
  if (info.timestamp_ns - began_ns_ < kWindowNs) return;
  behind_ = static_cast<double>(skipped_) > kMaxSkipped * static_cast<double>(frames_);
  began_ns_ = info.timestamp_ns;
  frames_ = 0;
  skipped_ = 0;
}

bool CameraWatch::arrived(const hal::FrameInfo& info, std::int64_t now_ns) noexcept {
  const bool was_away = std::exchange(away_, false);
  const bool returned = was_away || (info.flags & hal::kFrameReopened) != 0;
  if ((info.flags & hal::kFrameAfterGap) != 0) lose(now_ns);
  if (returned) rate_.forget();
  if (returned) skips_.forget();
  rate_.add(info);
  skips_.add(info);
  last_ns_ = now_ns;
  stalled_ = false;
  damaged_ = false;
  return returned;
}

void CameraWatch::missed(hal::GrabStatus status, std::int64_t now_ns) noexcept {
  damaged_ = status == hal::GrabStatus::damaged;
  switch (status) {
    case hal::GrabStatus::unplugged:
    case hal::GrabStatus::ended:
      away_ = true;
      rate_.forget();
      skips_.forget();
      break;
    case hal::GrabStatus::damaged:
      lose(now_ns);
      skips_.add_damaged();
      break;
    case hal::GrabStatus::timeout:
    case hal::GrabStatus::ok:
      break;
  }
  stalled_ = now_ns - last_ns_ > hal::stall_ns(period_ns_);
}

void CameraWatch::lose(std::int64_t now_ns) noexcept {
  lost_ = true;
  lost_ns_ = now_ns;
}

}  // namespace dtact::pipeline
