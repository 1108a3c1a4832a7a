#include "hal/null/null.hpp"

#include <cmath>

namespace dtact::hal::null {

NullCamera::NullCamera(const CameraConfig& config, base::Clock& clock)
    : config_(config),
      clock_(clock),
      pixels_(static_cast<std::size_t>(config.width) * static_cast<std::size_t>(config.height) +
                  kLumaPadding,
              kGrey),
      period_ns_(std::llround(1e9 / config.fps)) {}

CameraInfo NullCamera::info() const {
  CameraInfo info;
  info.backend = "null";
  info.identity = "null";
  info.pixel_format = "GREY";
  info.width = config_.width;
  info.height = config_.height;
  info.fps = config_.fps;
  info.light_delay_frames = 0;
  return info;
}

CameraReport NullCamera::report() const {
  CameraReport report;
  report.delivered = delivered_;
  return report;
}

void NullCamera::start() { next_ns_ = clock_.monotonic_ns() + period_ns_; }

GrabStatus NullCamera::grab(Frame& out, std::chrono::nanoseconds timeout) noexcept {
  const std::int64_t latest = clock_.monotonic_ns() + timeout.count();
  if (next_ns_ > latest) {
    clock_.sleep_until(latest);
    return GrabStatus::timeout;
  }
  clock_.sleep_until(next_ns_);
  FrameInfo frame;
  frame.sequence = delivered_++;
  frame.timestamp_ns = next_ns_;
  frame.ready_ns = next_ns_;
  frame.meaning = TimestampMeaning::end_of_frame;
  // From the previous deadline, not from now: a late wake-up does not slow the rate.
  next_ns_ += period_ns_;
  out = Frame(*this, 0, {pixels_.data(), config_.width, config_.height, config_.width}, frame);
  return GrabStatus::ok;
}

void NullCamera::give_back(int /*index*/) noexcept {}

}  // namespace dtact::hal::null
