#include "daemon/pipeline/camera_watch.hpp"

#include <utility>

namespace dtact::pipeline {

bool CameraWatch::arrived(const hal::FrameInfo& info, std::int64_t now_ns) noexcept {
  const bool was_away = std::exchange(away_, false);
  const bool returned = was_away || (info.flags & hal::kFrameReopened) != 0;
  if ((info.flags & hal::kFrameAfterGap) != 0) lose(now_ns);
  if (returned) rate_.forget();
  rate_.add(info);
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
      break;
    case hal::GrabStatus::damaged:
      lose(now_ns);
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
