// What the capture loop is told from outside, and how it answers: notes of the light, orders.
#include <utility>

#include "daemon/pipeline/capture_loop.hpp"

namespace dtact::pipeline {
namespace {

constexpr const char* kTouchedSentence = "something touches: lift it and ask again, or force it";
constexpr const char* kUnsteadySentence =
    "the image does not hold still: lift what touches and ask again, or force it";
constexpr const char* kDarkSentence =
    "the image is too dark to be a reference: make the light brighter";
constexpr const char* kUncalibratedSentence =
    "there is no calibration, so nothing to re-zero: make one with dtactctl calibrate depth and "
    "send it with dtactctl calibration upload";
constexpr const char* kAwaySentence =
    "the camera delivers no frames: see its condition in the status";

}  // namespace

void CaptureLoop::take_notes() noexcept {
  LightNote note;
  while (light_.next_note(note)) {
    // Rewriting what is shown anyway leaves the reference as good as it was.
    if (note.light != shown_) {
      keeper_.light_changed(contact_.touching(), note.light.leds == shown_.leds);
      shown_ = note.light;
    }
    if (note.begins) {
      timeline_.change_begins(note.light, note.at_ns);
    } else {
      timeline_.change_ends(note.light, note.at_ns);
    }
    light_mismatch_ = active_ && light_differs(*active_->calibration, shown_);
  }
}

void CaptureLoop::take_orders() noexcept {
  // One at a time, and only while its answer and a retired calibration have somewhere to go.
  Order order;
  while (!rezero_ && !teller_.answer_due() && exchange_.retired.room() > 0 &&
         exchange_.orders.pop(order)) {
    if (const auto* rezero = std::get_if<RezeroOrder>(&order)) execute(*rezero);
    if (auto* calibration = std::get_if<CalibrationOrder>(&order)) execute(*calibration);
    teller_.flush();
  }
}

void CaptureLoop::execute(const RezeroOrder& order) noexcept {
  if (!active_) {
    teller_.answer({order.ticket, Outcome::invalid, kUncalibratedSentence});
  } else if (watch_.away()) {
    teller_.answer({order.ticket, Outcome::camera_away, kAwaySentence});
  } else {
    rezero_ = order.ticket;
    if (const auto refused = keeper_.rezero(order.force, contact_.touching())) answer(*refused);
  }
}

void CaptureLoop::execute(CalibrationOrder& order) noexcept {
  std::swap(active_, order.next);
  unusable_ = false;
  const recon::Model& model = *active_->calibration->model;
  keeper_.use_calibration(model.reference_q8, active_->grid, active_->region);
  place_.use_calibration(active_->calibration, active_->region);
  if (keeper_.ready()) use_reference();
  light_mismatch_ = light_differs(*active_->calibration, shown_);
  keep_due_ = keeper_.ready() && keeper_.worth_keeping();
  exchange_.camera_mismatch.store(active_->camera_mismatch, std::memory_order_relaxed);
  exchange_.generation.store(active_->generation, std::memory_order_release);
  if (order.next) (void)exchange_.retired.push(std::move(order.next));  // room was made sure of
  teller_.answer({order.ticket, Outcome::done, ""});
}

void CaptureLoop::answer(RezeroResult result) noexcept {
  switch (result) {
    case RezeroResult::taken:
      return answer(Outcome::done, "");
    case RezeroResult::touched:
      return answer(Outcome::refused_contact, kTouchedSentence);
    case RezeroResult::unsteady:
      return answer(Outcome::refused_contact, kUnsteadySentence);
    case RezeroResult::dark:
      return answer(Outcome::invalid, kDarkSentence);
  }
}

void CaptureLoop::answer(Outcome outcome, const char* sentence) noexcept {
  if (rezero_) teller_.answer({*rezero_, outcome, sentence});
  rezero_.reset();
}

void CaptureLoop::give_up_rezero() noexcept {
  keeper_.cancel_rezero();
  answer(Outcome::camera_away, kAwaySentence);
}

}  // namespace dtact::pipeline
