#include "hal/libcamera/skip_frames.hpp"

#include "hal/base/clock.hpp"

namespace dtact::hal::libcamera_backend {

bool skip_frames(live::Source& source, int frames, std::int64_t deadline_ns,
                 const std::function<bool()>& worth_it) {
  while (frames > 0) {
    live::FilledBuffer filled;
    const live::DequeueStatus status = source.dequeue(filled);
    if (status == live::DequeueStatus::none) {
      if (base::system_clock().monotonic_ns() >= deadline_ns) return false;
      source.wait(deadline_ns);
      continue;
    }
    if (status == live::DequeueStatus::failed || !source.enqueue(filled.index)) return false;
    if (!worth_it()) return false;
    --frames;
  }
  return true;
}

}  // namespace dtact::hal::libcamera_backend
