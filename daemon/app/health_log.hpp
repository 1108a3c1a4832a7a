#pragma once

#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "daemon/pipeline/port.hpp"

namespace dtact::app {

/// The log's lines about health flags: one when a flag is set, with the fix, and one when it is
/// cleared. A flag that comes and goes is logged once a minute, with the number of
/// times.
class HealthLog {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kPause{60};

  struct Line {
    bool warning = false;
    std::string flag;  ///< Its name on the wire: "camera_fault".
    std::string text;
  };

  /// `reported`: flags already logged in a more detailed line.
  explicit HealthLog(pipeline::HealthSet reported);
  /// The lines that are due, from what the pipeline says at `now`.
  [[nodiscard]] std::vector<Line> step(const pipeline::Status& status, Time now);

 private:
  struct Flag {
    bool known = false;  ///< The log has announced its start, less than kPause ago.
    bool on = false;
    bool reported = false;  ///< Its start has been logged, its end not yet.
    unsigned times = 0;     ///< Starts since the last line.
    Time last = Time::min();
  };
  std::array<Flag, pipeline::kHealthCount> health_flags_{};
  Time began_ = Time::min();  ///< The first step.
};

}  // namespace dtact::app
