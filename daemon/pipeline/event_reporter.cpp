#include "daemon/pipeline/event_reporter.hpp"

#include <atomic>
#include <utility>

namespace dtact::pipeline {
namespace {

constexpr std::int64_t kLastsNs = 1'000'000'000;

}  // namespace

/// Moves from `event` only when true.
template <typename T>
bool EventReporter::push(T&& event) noexcept {
  if (!exchange_.events.push(std::forward<T>(event))) return false;
  exchange_.wake.signal();
  return true;
}

void EventReporter::contact(const DepthFrame& frame) noexcept {
  // Nobody is there to receive its end.
  if (frame.contact_absence == ContactAbsence::unasked) in_contact_ = false;
  const bool in_contact = frame.contact.in_contact;
  if (frame.contact_absence != ContactAbsence::none || in_contact == in_contact_) return;
  const Stamp at{frame.camera.sequence, frame.camera.timestamp_ns, frame.wall_ns};
  if (push(ContactChanged{in_contact, at, frame.contact})) in_contact_ = in_contact;
}

void EventReporter::state(State state, HealthSet health, const Stamp& now) noexcept {
  if (health.has(Health::beyond_calibration)) beyond_until_ns_ = now.monotonic_ns + kLastsNs;
  health.set(Health::beyond_calibration, now.monotonic_ns < beyond_until_ns_);
  // Before the event: a client that receives it may ask for the status at once.
  exchange_.state.store(state, std::memory_order_relaxed);
  exchange_.health.store(health.bits(), std::memory_order_relaxed);
  if (state_ && state_->state == state && state_->health == health) return;
  const StateChanged changed{state, health, now};
  if (push(changed)) state_ = changed;
}

void EventReporter::flush() noexcept {
  if (answer_ && push(std::move(*answer_))) answer_.reset();
  if (reference_ && push(*reference_)) reference_.reset();
}

}  // namespace dtact::pipeline
