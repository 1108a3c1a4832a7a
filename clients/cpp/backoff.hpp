#pragma once

#include <algorithm>
#include <chrono>
#include <random>

#include "clients/cpp/options.hpp"

namespace dtact::client {

/// The waits between attempts, as Reconnect explains them. Not part of the library's interface.
class BackOff {
 public:
  BackOff(const Reconnect& limits, std::uint32_t seed) : limits_(limits), random_(seed) {}

  [[nodiscard]] std::chrono::milliseconds next() {
    delay_ = std::clamp(2 * delay_, limits_.min, std::max(limits_.min, limits_.max));
    return std::chrono::milliseconds(std::uniform_int_distribution<std::chrono::milliseconds::rep>(
        (delay_.count() + 1) / 2, delay_.count())(random_));
  }
  void reset() { delay_ = std::chrono::milliseconds(0); }

 private:
  Reconnect limits_;
  std::minstd_rand random_;
  std::chrono::milliseconds delay_{0};
};

}  // namespace dtact::client
