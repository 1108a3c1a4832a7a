#include "daemon/pipeline/teller.hpp"

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kLastsNs = 1'000'000'000;

}  // namespace

bool Teller::push(const Report& report) noexcept {
  if (!exchange_.reports.push(Report(report))) return false;
  exchange_.wake.signal();
  return true;
}

void Teller::contact(const DepthFrame& frame) noexcept {
  const bool touching = frame.contact.touching;
  if (touching == touching_) return;
  if (push(ContactChanged{touching, frame.camera.sequence, frame.camera.timestamp_ns,
                          frame.contact})) {
    touching_ = touching;
  }
}

HealthSet Teller::state(State state, HealthSet health, std::int64_t now_ns) noexcept {
  if (health.has(Health::beyond_calibration)) beyond_until_ns_ = now_ns + kLastsNs;
  health.set(Health::beyond_calibration, now_ns < beyond_until_ns_);
  if (state_ && state_->state == state && state_->health == health) return health;
  const StateChanged changed{state, health};
  if (push(changed)) state_ = changed;
  return health;
}

void Teller::flush() noexcept {
  if (answer_ && push(*answer_)) answer_.reset();
  if (reference_ && push(*reference_)) reference_.reset();
}

}  // namespace dtact::pipeline
