#include "clients/perceive/newest_frame.hpp"

#include <utility>

namespace dtact::perceive {

void NewestFrame::put(v1::Frame frame) {
  if (newest_) {
    const v1::Frame& before = newest_->frame;
    parted_ |= before.has_contact() && !before.contact().in_contact();
  }
  const std::uint64_t missed = newest_ ? newest_->missed + 1 : 0;
  newest_ = Taken{std::move(frame), missed};
}

void NewestFrame::part() {
  newest_.reset();
  parted_ = true;
}

std::optional<NewestFrame::Taken> NewestFrame::take() {
  if (newest_) newest_->parted = std::exchange(parted_, false);
  return std::exchange(newest_, std::nullopt);
}

}  // namespace dtact::perceive
