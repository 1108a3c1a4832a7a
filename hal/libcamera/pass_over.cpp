#include "hal/libcamera/pass_over.hpp"

#include "hal/base/clock.hpp"

namespace dtact::hal::libcamera_backend {

bool pass_over(live::Source& source, int frames, std::int64_t deadline_ns,
               const std::function<bool()>& worth_it) {
  while (frames > 0) {
    live::Filled filled;
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
