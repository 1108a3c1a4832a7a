#include "hal/base/realtime_throttle.hpp"

#include <sys/resource.h>

namespace dtact::base {
namespace {

long voluntary_switches() noexcept {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nvcsw;
}

}  // namespace

void RealtimeThrottle::pause_if_busy() noexcept {
  const std::int64_t now_ns = clock_.monotonic_ns();
  if (now_ns - looked_ns_ < std::chrono::nanoseconds(kInterval).count()) return;
  if (voluntary_switches() == waits_) clock_.sleep_until(now_ns + pause_.count());
  looked_ns_ = clock_.monotonic_ns();
  waits_ = voluntary_switches();
}

}  // namespace dtact::base
