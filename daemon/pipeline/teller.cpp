#include "daemon/pipeline/teller.hpp"

namespace dtact::pipeline {

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

void Teller::state(State state, HealthSet health) noexcept {
  if (state_ && state_->state == state && state_->health == health) return;
  const StateChanged changed{state, health};
  if (push(changed)) state_ = changed;
}

void Teller::flush() noexcept {
  if (answer_ && push(*answer_)) answer_.reset();
  if (reference_ && push(*reference_)) reference_.reset();
}

}  // namespace dtact::pipeline
