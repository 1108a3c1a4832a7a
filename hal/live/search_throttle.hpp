#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "hal/live/source.hpp"

namespace dtact::hal::live {

/// Limits how often to search for cameras: every two seconds, and on each try while camera nodes
/// are new. A search opens every video or media device of the machine, and some of them
/// start firmware.
class SearchThrottle {
 public:
  static constexpr std::chrono::seconds kPeriod{2};

  /// `devices`: where the nodes are.
  explicit SearchThrottle(std::string devices = "/dev") : devices_(std::move(devices)) {}

  /// Whether to look now, which it is of both clocks; true: the caller does.
  [[nodiscard]] bool due(std::chrono::steady_clock::time_point now,
                         std::chrono::system_clock::time_point date);

 private:
  std::string devices_;
  std::optional<std::chrono::steady_clock::time_point> last_;
};

/// `open`, called as often as `pace` allows after it has failed; in between the last failure is
/// thrown again.
[[nodiscard]] Opener paced(Opener open, SearchThrottle pace = SearchThrottle());

}  // namespace dtact::hal::live
