#include "daemon/pipeline/light_timeline.hpp"

namespace dtact::pipeline {

std::int64_t exposure_start_ns(const hal::FrameInfo& info, std::int64_t period_ns) noexcept {
  return info.meaning == hal::TimestampMeaning::start_of_exposure ? info.timestamp_ns
                                                                  : info.timestamp_ns - period_ns;
}

void LightTimeline::change_begins(const hal::Light& light, std::int64_t at_ns) noexcept {
  before_ = now_;
  now_ = light;
  began_ns_ = at_ns;
  writing_ = true;
}

void LightTimeline::change_ends(const hal::Light& light, std::int64_t at_ns) noexcept {
  now_ = light;
  settled_from_ns_ = at_ns + delay_ns_;
  writing_ = false;
}

}  // namespace dtact::pipeline
