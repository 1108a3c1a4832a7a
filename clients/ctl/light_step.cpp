#include "clients/ctl/light_step.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace dtact::ctl {
namespace {

/// Share of the step: a mean this near to its final value counts as complete.
constexpr double kComplete = 0.02;
/// Grey levels by which a mean at rest may vary, for any size of the step.
constexpr double kMaxWander = 0.25;

}  // namespace

LightStep::Verdict LightStep::add(std::uint64_t sequence, bool lit, double mean_grey) {
  if (!lit) {
    before_ = sequence;
    return Verdict::going_on;
  }
  seen_.push_back({sequence, mean_grey});
  return seen_.size() < kRest ? Verdict::going_on : judge();
}

LightStep::Verdict LightStep::judge() {
  const auto rest = std::span(seen_).last(kRest);
  double sum = 0;
  for (const Sample& one : rest) sum += one.grey;
  grey_ = sum / static_cast<double>(kRest);
  const double step = std::abs(grey_ - before_grey_);
  const double near = std::max(kMaxWander, kComplete * step);
  const auto incomplete = [&](const Sample& one) { return std::abs(one.grey - grey_) > near; };
  const bool at_rest = std::ranges::none_of(rest, incomplete);
  if (!at_rest || step < kMinStep) {
    if (seen_.size() < kMaxFrames) return Verdict::going_on;
    return at_rest ? Verdict::unseen : Verdict::restless;
  }
  std::uint64_t last = before_;
  std::size_t complete = seen_.size();
  while (complete > 0 && !incomplete(seen_[complete - 1])) --complete;
  if (complete > 0) last = seen_[complete - 1].sequence;
  // What a missing frame showed is not known.
  if (seen_.front().sequence != before_ + 1 || seen_[complete].sequence != last + 1) {
    return Verdict::gap;
  }
  frames_ = static_cast<int>(last - before_);
  return Verdict::settled;
}

}  // namespace dtact::ctl
