#include "daemon/pipeline/order_desk.hpp"

#include <algorithm>
#include <utility>
#include <variant>

namespace dtact::pipeline {
namespace {

constexpr const char* kTouchedSentence = "something touches: lift it and ask again, or force it";
constexpr const char* kUnsteadySentence =
    "the image does not hold still: lift what touches and ask again, or force it";
constexpr const char* kDarkSentence =
    "the image is too dark to be a reference: make the light brighter";
constexpr const char* kUncalibratedSentence =
    "there is no calibration, so nothing to re-zero: make one with dtact-calibrate depth and "
    "send it with dtactctl calibration upload";
constexpr const char* kNoCalibrationSentence =
    "there is no calibration, so depth is measured against nothing: make one with "
    "dtact-calibrate depth and send it with dtactctl calibration upload";
constexpr const char* kNoReferenceSentence =
    "the untouched image is being taken: ask again when the state is serving";
constexpr const char* kAwaySentence =
    "the camera delivers no frames: see its condition in the status";

}  // namespace

void OrderDesk::begin(std::unique_ptr<ActiveCalibration> active) noexcept {
  active_ = std::move(active);
  if (active_) use();
}

void OrderDesk::take(bool camera_away, const Stamp& now) noexcept {
  // One at a time, and only while its answer and a retired calibration have somewhere to go.
  Order order;
  while (!rezero_ && !teller_.answer_due() && exchange_.retired.room() > 0 &&
         exchange_.orders.pop(order)) {
    if (const auto* rezero = std::get_if<RezeroOrder>(&order)) execute(*rezero, camera_away);
    if (auto* calibration = std::get_if<CalibrationOrder>(&order)) execute(*calibration, now);
    if (const auto* reference = std::get_if<ReferenceOrder>(&order)) execute(*reference);
    teller_.flush();
  }
}

void OrderDesk::execute(const RezeroOrder& order, bool camera_away) noexcept {
  rezero_ = order.ticket;
  if (!active_) {
    answer(Outcome::uncalibrated, kUncalibratedSentence);
  } else if (camera_away) {
    answer(Outcome::camera_away, kAwaySentence);
  } else if (const auto refused = untouched_.rezero(order.force)) {
    answer(*refused);
  }
}

void OrderDesk::execute(CalibrationOrder& order, const Stamp& now) noexcept {
  const bool same_image = order.same_image && active_ != nullptr;
  if (same_image) std::swap(active_->image, order.next->image);
  std::swap(active_, order.next);
  if (same_image) {
    untouched_.lies_at(&active_->image);
    use_maps();
  } else {
    use();
  }
  exchange_.camera_mismatch.store(active_->camera_mismatch, std::memory_order_relaxed);
  exchange_.generation.store(active_->generation, std::memory_order_release);
  if (order.next) (void)exchange_.retired.push(std::move(order.next));  // room was made sure of
  teller_.answer({order.ticket, Outcome::done, "", now});
}

void OrderDesk::execute(const ReferenceOrder& order) noexcept {
  if (!active_) {
    return teller_.answer({order.ticket, Outcome::uncalibrated, kNoCalibrationSentence});
  }
  if (!untouched_.ready()) {
    return teller_.answer({order.ticket, Outcome::no_reference, kNoReferenceSentence});
  }
  std::ranges::copy(untouched_.reference(), order.out->image_q8.begin());
  order.out->light = untouched_.shown();
  order.out->sequence = reference_sequence_;
  order.out->calibration = active_->key;
  teller_.answer({order.ticket, Outcome::done, ""});
}

void OrderDesk::use() noexcept {
  untouched_.use(&active_->image);
  use_maps();
}

void OrderDesk::use_maps() noexcept {
  depth_.use(&active_->maps, active_->generation);
  if (!untouched_.ready()) return;
  depth_.set_reference(untouched_.reference());
  depth_.set_light(untouched_.light());
}

void OrderDesk::answer(RezeroResult result) noexcept {
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

void OrderDesk::answer(Outcome outcome, const char* sentence) noexcept {
  if (rezero_) teller_.answer({*rezero_, outcome, sentence});
  rezero_.reset();
}

void OrderDesk::give_up_rezero() noexcept {
  untouched_.cancel_rezero();
  answer(Outcome::camera_away, kAwaySentence);
}

}  // namespace dtact::pipeline
