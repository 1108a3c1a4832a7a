#pragma once

#include <algorithm>
#include <chrono>

namespace dtact::net {

/// Per second, and as much at once as `burst` after a rest.
class TokenBucket {
 public:
  using Clock = std::chrono::steady_clock;

  TokenBucket(double per_second, double burst, Clock::time_point now = Clock::now())
      : per_second_(per_second), burst_(burst), left_(burst), then_(now) {}

  /// False, and nothing is taken, when fewer would be left than `reserve`. A cost above what there
  /// can ever be takes all of it.
  [[nodiscard]] bool take(double cost, double reserve = 0, Clock::time_point now = Clock::now()) {
    left_ =
        std::min(burst_, left_ + per_second_ * std::chrono::duration<double>(now - then_).count());
    then_ = now;
    cost = std::min(cost, burst_ - reserve);
    if (left_ < cost + reserve) return false;
    left_ -= cost;
    return true;
  }

 private:
  double per_second_;
  double burst_;
  double left_;
  Clock::time_point then_;
};

}  // namespace dtact::net
