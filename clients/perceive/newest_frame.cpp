#include "clients/perceive/newest_frame.hpp"

#include <algorithm>
#include <utility>

namespace dtact::perceive {

void NewestFrame::put(v1::Frame frame) {
  if (newest_) {
    const v1::Frame& before = newest_->frame;
    parted_ |= before.has_contact() && !before.contact().in_contact();
  }
  const std::uint64_t missed = (newest_ ? newest_->missed + 1 : 0) + frame.dropped() -
                               std::min<std::uint64_t>(dropped_, frame.dropped());
  dropped_ = frame.dropped();
  newest_ = Taken{std::move(frame), missed};
}

void NewestFrame::part() {
  newest_.reset();
  dropped_ = 0;
  parted_ = true;
}

std::optional<NewestFrame::Taken> NewestFrame::take() {
  if (newest_) newest_->parted = std::exchange(parted_, false);
  return std::exchange(newest_, std::nullopt);
}

}  // namespace dtact::perceive
