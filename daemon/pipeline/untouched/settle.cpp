#include "daemon/pipeline/untouched/settle.hpp"

#include <algorithm>
#include <stdexcept>

namespace dtact::pipeline {

SettleDetector::SettleDetector(const ReferenceRules& rules)
    : frames_(static_cast<std::size_t>(rules.settle_frames)), grey_(rules.settle_grey) {
  if (rules.settle_frames < 2 || frames_ > kMost) {
    throw std::invalid_argument("reference: settle_frames must be 2 to 64");
  }
}

bool SettleDetector::add(float mean_grey) noexcept {
  means_[count_ % frames_] = mean_grey;
  ++count_;
  if (count_ < frames_) return false;
  const auto [least, most] =
      std::minmax_element(means_.begin(), means_.begin() + static_cast<std::ptrdiff_t>(frames_));
  return *most - *least < grey_;
}

}  // namespace dtact::pipeline
