#include "daemon/pipeline/untouched/exposure_watch.hpp"

#include <algorithm>

namespace dtact::pipeline {

void ExposureWatch::forget() noexcept {
  untouched_ns_.reset();
  since_ns_.reset();
}

void ExposureWatch::look(const LightSeen& light, const std::optional<LightCompared>& compared,
                         std::int64_t timestamp_ns) noexcept {
  // Never below 0: what looks like a dimmer light may be a press of the whole field.
  if (light.from == LightSeen::From::all) {
    untouched_ = std::max(0.0, light.change);
    untouched_ns_ = timestamp_ns;
  }
  if (!compared) return;
  const double brighter = compared->brighter - untouched_;
  const double keeps_mean = compared->lost / (1 - compared->lost);
  const bool seen = compared->lost >= kLost && brighter >= kBrighter &&
                    brighter >= kLeastShare * keeps_mean && brighter <= kMostShare * keeps_mean;
  if (!seen) {
    since_ns_.reset();
    return;
  }
  const bool soon = untouched_ns_ && timestamp_ns - *untouched_ns_ < kSoonNs;
  if (!since_ns_ && soon) since_ns_ = timestamp_ns;
  follows_ = follows_ || (since_ns_ && timestamp_ns - *since_ns_ >= kLastsNs);
}

}  // namespace dtact::pipeline
