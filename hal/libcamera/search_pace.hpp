#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <utility>

namespace dtact::hal::libcamera_backend {

/// When it is worth while to look for cameras: every so often, and in each try while the nodes of
/// cameras are new. Beginning a manager opens every media device of the machine.
class SearchPace {
 public:
  static constexpr std::chrono::seconds kPeriod{2};

  /// `devices`: where the nodes are.
  explicit SearchPace(std::string devices = "/dev") : devices_(std::move(devices)) {}

  /// Whether to look now, which it is of both clocks; true: the caller does.
  [[nodiscard]] bool due(std::chrono::steady_clock::time_point now,
                         std::chrono::system_clock::time_point date);

 private:
  std::string devices_;
  std::optional<std::chrono::steady_clock::time_point> last_;
};

}  // namespace dtact::hal::libcamera_backend
