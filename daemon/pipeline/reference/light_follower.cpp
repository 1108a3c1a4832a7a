#include "daemon/pipeline/reference/light_follower.hpp"

#include <algorithm>
#include <cmath>

namespace dtact::pipeline {
namespace {

/// A sixteenth of a grey level, 2 µm: applying a factor costs as much as a frame.
constexpr double kMinStep = 0.0004;
/// What is expected out of sight at most where nothing is followed: the default limit.
constexpr double kUnfollowed = DriftRules{}.limit_percent / 100;

}  // namespace

LightFollower::LightFollower(const DriftRules& rules) noexcept
    : rate_(rules.percent_per_minute / 100 / 60), limit_(rules.limit_percent / 100) {}

void LightFollower::restart(bool follows) noexcept {
  follows_ = follows;
  applied_ = followed_ = 1;
  allowance_ = 0;
  lost_ = false;
  left_ = 0;
  drifted_ = false;
  disagreeing_ = 0;
  before_ns_.reset();
  from_ = LightSeen::From::nothing;
  quiet_ns_ = 0;
  unseen_ns_ = 0;
}

std::optional<double> LightFollower::look(const LightSeen& light,
                                          std::int64_t timestamp_ns) noexcept {
  const std::int64_t passed_ns =
      std::max<std::int64_t>(0, timestamp_ns - before_ns_.value_or(timestamp_ns));
  before_ns_ = timestamp_ns;
  const double may_move = allowance_ + rate_ * static_cast<double>(passed_ns) * 1e-9;
  if (light.from == LightSeen::From::nothing) {
    unseen_ns_ += passed_ns;
    if (unseen_ns_ > kUnseenNs) from_ = LightSeen::From::nothing;
    if (follows_ && !lost_) allowance_ = std::min(may_move, limit_);
    return std::nullopt;
  }
  quiet_ns_ = light.from == from_ ? quiet_ns_ + timestamp_ns - seen_ns_ : 0;
  from_ = light.from;
  seen_ns_ = timestamp_ns;
  unseen_ns_ = 0;
  const double gap = applied_ * (1 + light.change) - followed_;
  lost_ = std::abs(gap) > kStep + allowance_;
  set_left(light.change);
  if (lost_ || !follows_) return std::nullopt;
  if (quiet_ns_ < kQuietNs) {
    allowance_ = std::min(may_move, limit_);
    return std::nullopt;
  }
  followed_ = std::clamp(followed_ + std::clamp(gap, -may_move, may_move), 1 - limit_, 1 + limit_);
  allowance_ = 0;
  if (std::abs(followed_ - applied_) < kMinStep) return std::nullopt;
  applied_ = followed_;
  return applied_;
}

double LightFollower::unseen() const noexcept {
  if (unseen_ns_ <= kUnseenNs) return 0;
  const double most = limit_ > 0 ? limit_ : kUnfollowed;
  return std::min(rate_ * static_cast<double>(unseen_ns_) * 1e-9, most) / 2;
}

void LightFollower::set_left(double left) noexcept {
  left_ = left;
  disagreeing_ = (std::abs(left) > kReportedDrift) != drifted_ ? disagreeing_ + 1 : 0;
  if (disagreeing_ < kReportedDriftFrames) return;
  drifted_ = !drifted_;
  disagreeing_ = 0;
}

}  // namespace dtact::pipeline
