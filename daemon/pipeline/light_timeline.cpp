#include "daemon/pipeline/light_timeline.hpp"

#include <utility>

namespace dtact::pipeline {

std::int64_t stamp_lag_ns(hal::TimestampMeaning meaning, std::int64_t period_ns) noexcept {
  return meaning == hal::TimestampMeaning::start_of_exposure ? 0 : period_ns;
}

std::int64_t exposure_start_ns(const hal::FrameInfo& info, std::int64_t period_ns) noexcept {
  return info.timestamp_ns - stamp_lag_ns(info.meaning, period_ns);
}

void LightTimeline::change_begins(const hal::Light& light, std::int64_t at_ns) noexcept {
  before_ = now_;
  before_since_ns_ = std::exchange(now_since_ns_, std::nullopt);
  now_ = light;
  began_ns_ = at_ns;
  writing_ = true;
}

void LightTimeline::change_ends(const hal::Light& light, std::int64_t at_ns, bool failed) noexcept {
  now_ = light;
  settled_from_ns_ = at_ns + delay_ns_;
  if (!failed) now_since_ns_ = settled_from_ns_;
  writing_ = false;
}

}  // namespace dtact::pipeline
